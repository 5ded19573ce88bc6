#pragma once

#ifdef EVENTGAN_THREAD_SANITIZER
extern "C" void __tsan_acquire(void* thing);
extern "C" void __tsan_release(void* thing);
#endif

namespace eventgan {

// For the thread sanitizer, which does not see how oneTBB, not built for it, orders tasks: it would
// take what they share for races, or, with all reports suppressed that pass through oneTBB, find no
// race in any task. So the sources that use oneTBB are compiled without the sanitizer, and say here
// what comes after what. Elsewhere none of this does anything.

/// What a thread has done comes before all that a thread does that takes `thing` over later.
inline void hand_over([[maybe_unused]] const void* thing) {
#ifdef EVENTGAN_THREAD_SANITIZER
  __tsan_release(const_cast<void*>(thing));
#endif
}

inline void take_over([[maybe_unused]] const void* thing) {
#ifdef EVENTGAN_THREAD_SANITIZER
  __tsan_acquire(const_cast<void*>(thing));
#endif
}

/// Tasks that a thread starts and, with the scope, has waited for.
class Tasks {
 public:
  Tasks() { hand_over(&begin_); }
  ~Tasks() { take_over(&end_); }
  Tasks(const Tasks&) = delete;
  Tasks& operator=(const Tasks&) = delete;

  /// What one of them does, after all that others did earlier with the same `thing`.
  class Work {
   public:
    Work(const Tasks& tasks, const void* thing) : tasks_(tasks), thing_(thing) {
      take_over(&tasks.begin_);
      take_over(thing_);
    }
    ~Work() {
      hand_over(thing_);
      hand_over(&tasks_.end_);
    }
    Work(const Work&) = delete;
    Work& operator=(const Work&) = delete;

   private:
    const Tasks& tasks_;
    const void* thing_;
  };

 private:
  char begin_ = 0, end_ = 0;
};

}  // namespace eventgan

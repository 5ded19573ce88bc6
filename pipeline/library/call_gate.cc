#include "pipeline/library/call_gate.h"

#include <pthread.h>

#include <new>

namespace eventgan {

CallGate& CallGate::instance() {
  static auto* const gate = new CallGate;  // also for threads that outlive the static objects
  return *gate;
}

CallGate::CallGate() {
  pthread_atfork([] { instance().close(); }, [] { instance().open(); },
                 [] { instance().open_in_child(); });
}

void CallGate::enter() {
  std::unique_lock lock(mutex_);
  changed_.wait(
      lock, [this] { return closed_ == 0 && (!ended_ || ending_ == std::this_thread::get_id()); });
  ++inside_;
}

void CallGate::leave() {
  const std::lock_guard lock(mutex_);
  if (--inside_ == 0) changed_.notify_all();
}

void CallGate::end() {
  std::unique_lock lock(mutex_);
  ended_ = true;
  ending_ = std::this_thread::get_id();
  changed_.wait(lock, [this] { return inside_ == 0; });
}

/// Keeps the lock until the fork is done, so that the child's copy is whole.
void CallGate::close() {
  std::unique_lock lock(mutex_);
  ++closed_;
  changed_.wait(lock, [this] { return inside_ == 0; });
  lock.release();
}

void CallGate::open() {
  const std::lock_guard lock(mutex_, std::adopt_lock);
  --closed_;
  changed_.notify_all();
}

/// The threads that waited here are not in the child, and a condition would wait for them.
void CallGate::open_in_child() {
  const std::lock_guard lock(mutex_, std::adopt_lock);
  new (&changed_) std::condition_variable;
  closed_ = 0;
  ended_ = false;
}

}  // namespace eventgan

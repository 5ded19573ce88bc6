#pragma once

#include <barrier>
#include <exception>
#include <functional>
#include <thread>
#include <vector>

namespace eventgan {

/// Threads that live as long as this and do one piece of work each, together, whenever asked: an
/// engine keeps settings and OpenMP its helpers by thread, which must not be made again while time
/// runs.
class InstanceThreads {
 public:
  /// `prepare` is called once in each thread before its first work. The callables must not outlive
  /// what they refer to; `work` gets the thread's number.
  InstanceThreads(int count, std::function<void()> prepare, std::function<void(int)> work);
  ~InstanceThreads();
  InstanceThreads(const InstanceThreads&) = delete;
  InstanceThreads& operator=(const InstanceThreads&) = delete;

  /// One piece in every thread; returns when all are done. Rethrows what one of them threw.
  void run();

 private:
  void serve(int number);

  std::function<void()> prepare_;
  std::function<void(int)> work_;
  std::barrier<> start_;
  std::barrier<> end_;
  bool stopped_ = false;                    ///< written before a start, read after it
  std::vector<std::exception_ptr> faults_;  ///< by thread
  std::vector<std::thread> threads_;
};

}  // namespace eventgan

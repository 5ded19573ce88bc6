#include "tests/benchmarks/engines/instance_threads.h"

#include <cstddef>
#include <utility>

namespace eventgan {

InstanceThreads::InstanceThreads(int count, std::function<void()> prepare,
                                 std::function<void(int)> work)
    : prepare_(std::move(prepare)),
      work_(std::move(work)),
      start_(count + 1),
      end_(count + 1),
      faults_(static_cast<std::size_t>(count)) {
  for (int number = 0; number < count; ++number) {
    threads_.emplace_back([this, number] { serve(number); });
  }
}

InstanceThreads::~InstanceThreads() {
  stopped_ = true;
  start_.arrive_and_wait();
  for (std::thread& thread : threads_) thread.join();
}

void InstanceThreads::run() {
  start_.arrive_and_wait();
  end_.arrive_and_wait();
  for (std::exception_ptr& fault : faults_) {
    if (fault) std::rethrow_exception(std::exchange(fault, nullptr));
  }
}

void InstanceThreads::serve(int number) {
  bool prepared = false;
  for (start_.arrive_and_wait(); !stopped_; start_.arrive_and_wait()) {
    try {
      if (!std::exchange(prepared, true)) prepare_();
      work_(number);
    } catch (...) {
      faults_[static_cast<std::size_t>(number)] = std::current_exception();
    }
    end_.arrive_and_wait();
  }
}

}  // namespace eventgan

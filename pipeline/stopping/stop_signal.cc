#include "pipeline/stopping/stop_signal.h"

#include <time.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace eventgan {
namespace {

constexpr std::array kSignals{SIGINT, SIGTERM, SIGUSR1};
constexpr std::int64_t kNever = -1;

std::atomic<std::int64_t> requested_at_ns{kNever};
static_assert(std::atomic<std::int64_t>::is_always_lock_free, "a signal handler sets it");

/// One of the few functions that a signal handler may call.
std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

void request_stop(int) {
  std::int64_t never = kNever;
  requested_at_ns.compare_exchange_strong(never, monotonic_ns());
}

}  // namespace

StopSignal::StopSignal() {
  requested_at_ns = kNever;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = request_stop;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    if (kSignals[i] == SIGINT) action.sa_flags |= static_cast<int>(SA_RESETHAND);
    sigaction(kSignals[i], &action, &before_[i]);
  }
}

StopSignal::~StopSignal() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

bool StopSignal::requested() const { return requested_at_ns != kNever; }

std::optional<double> StopSignal::seconds_since_request() const {
  const std::int64_t at_ns = requested_at_ns;
  if (at_ns == kNever) return std::nullopt;
  return 1e-9 * static_cast<double>(monotonic_ns() - at_ns);
}

}  // namespace eventgan

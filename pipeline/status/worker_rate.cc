#include "pipeline/status/worker_rate.h"

#include <algorithm>

namespace eventgan {
namespace {

constexpr std::size_t kFewest = 8;
constexpr std::size_t kOfEachWriter = 3;

}  // namespace

std::optional<double> worker_rate(std::vector<CommitRecord> records, int writers) {
  std::erase_if(records, [](const CommitRecord& record) {
    return record.samples <= 0 || !(record.wall_seconds > 0);
  });
  if (records.empty()) return std::nullopt;
  const auto wanted = std::max(kFewest, kOfEachWriter * static_cast<std::size_t>(writers));
  const auto last = static_cast<std::ptrdiff_t>(std::min(records.size(), wanted));
  std::partial_sort(records.begin(), records.begin() + last, records.end(),
                    [](const auto& one, const auto& other) { return one.time_s > other.time_s; });
  std::vector<double> rates;
  for (auto record = records.begin(); record != records.begin() + last; ++record) {
    rates.push_back(record->samples / record->wall_seconds);
  }
  std::sort(rates.begin(), rates.end());
  const std::size_t middle = rates.size() / 2;
  return rates.size() % 2 == 1 ? rates[middle] : (rates[middle - 1] + rates[middle]) / 2;
}

}  // namespace eventgan

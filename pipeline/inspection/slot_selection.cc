#include "pipeline/inspection/slot_selection.h"

#include <algorithm>
#include <charconv>
#include <set>

#include "manifests/faults.h"

namespace eventgan {
namespace {

[[noreturn]] void fail(const std::string& text, int sample_count) {
  throw UsageError("--samples: expected slots 0.." + std::to_string(sample_count - 1) +
                   " such as 0,3-5, got \"" + text + "\"");
}

}  // namespace

std::vector<int> parse_slots(const std::string& text, int sample_count) {
  std::set<int> slots;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&] {
    int value = -1;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || value < 0 || value >= sample_count) fail(text, sample_count);
    at = next;
    return value;
  };
  while (true) {
    const int first = number();
    int last = first;
    if (at != end && *at == '-') {
      ++at;
      last = number();
    }
    if (last < first) fail(text, sample_count);
    for (int slot = first; slot <= last; ++slot) slots.insert(slot);
    if (at == end) break;
    if (*at++ != ',') fail(text, sample_count);
  }
  return {slots.begin(), slots.end()};
}

std::vector<int> spread_slots(int count, int sample_count) {
  std::vector<int> slots;
  const int taken = std::min(count, sample_count);
  for (int i = 0; i < taken; ++i) {
    slots.push_back(static_cast<int>(static_cast<long long>(i) * sample_count / taken));
  }
  return slots;
}

}  // namespace eventgan

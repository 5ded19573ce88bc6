#pragma once

#include <string>
#include <vector>

namespace eventgan {

/// Slots named by text such as "0,3-5": {0, 3, 4, 5}; ascending, each once. Throws UsageError for
/// anything else, or a slot that a shard of `sample_count` samples does not have.
std::vector<int> parse_slots(const std::string& text, int sample_count);

/// `count` slots spread evenly over a shard, the first included.
std::vector<int> spread_slots(int count, int sample_count);

}  // namespace eventgan

#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace eventgan {

/// At most `count` places spread evenly over `all`, ascending; the first is 0.
inline std::vector<std::size_t> spread(std::size_t count, std::size_t all) {
  std::vector<std::size_t> places(std::min(count, all));
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = i * all / places.size();
  return places;
}

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <string>

namespace eventgan {

/// How many outlines boxes have, and whence.
struct OutlineCounts {
  std::int64_t given = 0;  ///< the labels' own
  std::int64_t cut = 0;
  std::int64_t ellipses = 0;  ///< in place of a cut

  OutlineCounts& operator+=(const OutlineCounts& other);
  bool operator==(const OutlineCounts&) const = default;
};

/// "120 of labels, 300 cut out of their boxes, 12 ellipses".
std::string to_text(const OutlineCounts& counts);

}  // namespace eventgan

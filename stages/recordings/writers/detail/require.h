#pragma once

#include <stdexcept>

namespace eventgan {

/// Throws std::invalid_argument unless the condition holds.
inline void require(bool condition, const char* rule) {
  if (!condition) throw std::invalid_argument(rule);
}

}  // namespace eventgan

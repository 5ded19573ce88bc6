#include "stages/frames/padded_number.h"

#include <algorithm>

namespace eventgan {

std::string padded_number(std::int64_t number, std::size_t width) {
  const std::string digits = std::to_string(number);
  return std::string(width - std::min(width, digits.size()), '0') + digits;
}

}  // namespace eventgan

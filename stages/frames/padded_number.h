#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace eventgan {

/// `number` (not negative) with leading zeros up to `width` digits: "000006".
std::string padded_number(std::int64_t number, std::size_t width = 6);

}  // namespace eventgan

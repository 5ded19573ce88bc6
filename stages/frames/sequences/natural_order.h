#pragma once

#include <string_view>

namespace eventgan {

/// Orders names as people do: runs of digits by their value ("img2" before "img10"), all else by
/// its bytes. Names that differ only in leading zeros ("1", "01") are ordered by their bytes, so
/// the order is total.
bool natural_less(std::string_view a, std::string_view b);

}  // namespace eventgan

#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace eventgan {

// What one packed frame holds, of at most `most` bytes. Memory grows with what comes out, not with
// what the frame claims. Each throws EventFault "expected X, got Y". Thread safe.

std::string unpack_bz2(std::string_view packed, std::size_t most);
std::string unpack_lz4(std::string_view packed, std::size_t most);
std::string unpack_zstd(std::string_view packed, std::size_t most);

}  // namespace eventgan

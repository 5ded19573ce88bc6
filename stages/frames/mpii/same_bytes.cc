#include "stages/frames/mpii/same_bytes.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <system_error>

namespace eventgan {

bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error_a, error_b;
  const auto size_a = std::filesystem::file_size(a, error_a);
  const auto size_b = std::filesystem::file_size(b, error_b);
  if (error_a || error_b || size_a != size_b) return false;
  std::ifstream stream_a(a, std::ios::binary), stream_b(b, std::ios::binary);
  using Bytes = std::istreambuf_iterator<char>;
  return stream_a && stream_b && std::equal(Bytes(stream_a), Bytes(), Bytes(stream_b), Bytes());
}

}  // namespace eventgan

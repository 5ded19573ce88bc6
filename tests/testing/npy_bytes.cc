#include "tests/testing/npy_bytes.h"

#include <algorithm>
#include <cstring>

namespace eventgan::testing {
namespace {

std::string header_text(const std::string& descr, const std::vector<std::size_t>& shape) {
  std::string dimensions;
  for (const std::size_t size : shape) dimensions += std::to_string(size) + ", ";
  return "{'descr': '" + descr + "', 'fortran_order': False, 'shape': (" + dimensions + "), }";
}

}  // namespace

std::string npy_file(std::string_view header, std::string_view data, int version) {
  std::string bytes = std::string("\x93NUMPY") + static_cast<char>(version) + '\0';
  const std::size_t length_width = version == 1 ? 2 : 4;
  const std::size_t used = bytes.size() + length_width + header.size() + 1;
  const std::size_t padding = (64 - used % 64) % 64;
  const std::size_t length = header.size() + padding + 1;
  for (std::size_t i = 0; i < length_width; ++i) bytes += static_cast<char>(length >> (8 * i));
  return bytes.append(header).append(padding, ' ').append("\n").append(data);
}

std::string npy_doubles(const std::vector<std::size_t>& shape, const std::vector<double>& values) {
  std::string data(values.size() * sizeof(double), '\0');
  std::memcpy(data.data(), values.data(), data.size());
  return npy_file(header_text("<f8", shape), data);
}

std::string npy_strings(const std::vector<std::string>& values) {
  std::size_t longest = 1;
  for (const std::string& value : values) longest = std::max(longest, value.size());
  std::string data;
  for (const std::string& value : values) {
    for (std::size_t i = 0; i < longest; ++i) {  // UTF-32, little endian, padded with zeros
      data += i < value.size() ? value[i] : '\0';
      data.append(3, '\0');
    }
  }
  return npy_file(header_text("<U" + std::to_string(longest), {values.size()}), data);
}

}  // namespace eventgan::testing

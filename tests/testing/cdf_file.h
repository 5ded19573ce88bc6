#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace eventgan::testing {

/// A CDF file of one record of one matrix; its numbers in C order.
struct CdfMatrix {
  std::uint32_t rows = 0;
  std::uint32_t columns = 0;
  std::variant<std::vector<float>, std::vector<double>> values;
  std::string name = "Pose";
  std::uint32_t encoding = 6;  ///< IBM PC, little-endian; 1: network, big-endian
  bool is_row_major = true;
  bool packs_values = false;  ///< GZIP'd variable
  bool packs_file = false;    ///< GZIP'd file
  std::uint32_t room = 0;     ///< records that there is room for behind the one
};

/// Where the records lie in a file that is not packed; values are followed by the index of records.
inline constexpr std::size_t kCdfDescriptor = 8;
inline constexpr std::size_t kCdfGlobal = 320;
inline constexpr std::size_t kCdfCompression = 404;
inline constexpr std::size_t kCdfVariable = 432;
inline constexpr std::size_t kCdfValues = 792;

/// The file's bytes, after NASA's "CDF Internal Format Description" of version 3.
std::string cdf_bytes(const CdfMatrix& matrix);

}  // namespace eventgan::testing

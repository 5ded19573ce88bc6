#include "tests/testing/cdf_file.h"

#include <zlib.h>

#include <bit>
#include <cstddef>
#include <stdexcept>

namespace eventgan::testing {
namespace {

template <class T>
std::string big_endian(T value) {
  std::string bytes;
  for (int shift = 8 * sizeof(T) - 8; shift >= 0; shift -= 8) {
    bytes += static_cast<char>(value >> shift & 0xff);
  }
  return bytes;
}

std::string four(std::uint32_t value) { return big_endian(value); }
std::string eight(std::uint64_t value) { return big_endian(value); }

constexpr std::uint32_t kNone = 0xffffffff;
const std::string kNoOffset = eight(~std::uint64_t{0});

std::string record(std::uint32_t type, const std::string& fields) {
  return eight(12 + fields.size()) + four(type) + fields;
}

std::string gzip(const std::string& bytes) {
  z_stream state{};
  constexpr int kWithGzipHeader = 15 + 16;
  if (deflateInit2(&state, 6, Z_DEFLATED, kWithGzipHeader, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::runtime_error("zlib cannot start");
  }
  std::string packed(deflateBound(&state, bytes.size()), '\0');
  state.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  state.avail_in = static_cast<uInt>(bytes.size());
  state.next_out = reinterpret_cast<Bytef*>(packed.data());
  state.avail_out = static_cast<uInt>(packed.size());
  deflate(&state, Z_FINISH);
  packed.resize(state.total_out);
  deflateEnd(&state);
  return packed;
}

template <class Word, class Number>
std::string stored(const std::vector<Number>& values, const CdfMatrix& matrix) {
  std::string bytes;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t place =
        matrix.is_row_major ? i : i % matrix.rows * matrix.columns + i / matrix.rows;
    std::string number = big_endian(std::bit_cast<Word>(values[place]));
    bytes += matrix.encoding == 6 ? std::string(number.rbegin(), number.rend()) : number;
  }
  return bytes + std::string(matrix.room * bytes.size(), '\x55');
}

}  // namespace

std::string cdf_bytes(const CdfMatrix& matrix) {
  const bool is_float = matrix.values.index() == 0;
  std::string values = is_float ? stored<std::uint32_t>(std::get<0>(matrix.values), matrix)
                                : stored<std::uint64_t>(std::get<1>(matrix.values), matrix);
  if (matrix.packs_values) {
    values = gzip(values);
    values = record(13, four(0) + eight(values.size()) + values);
  } else {
    values = record(7, values);
  }
  const std::size_t index = kCdfValues + values.size();
  constexpr std::uint32_t kEntries = 3;
  const std::string entries = four(0) + four(kNone) + four(kNone) +            // first records
                              four(matrix.room) + four(kNone) + four(kNone) +  // last records
                              eight(kCdfValues) + kNoOffset + kNoOffset;
  const std::string compression = record(11, four(5) + four(0) + four(1) + four(6));

  const std::string descriptor =
      record(1, eight(kCdfGlobal) + four(3) + four(9) + four(matrix.encoding) +
                    four(matrix.is_row_major ? 3 : 2) + four(0) + four(0) + four(0) + four(2) +
                    four(kNone) + std::string(256, '\0'));
  const std::string global = record(
      2, eight(0) + eight(kCdfVariable) + eight(0) + eight(index + 76) + four(0) + four(0) +
             four(kNone) + four(0) + four(1) + eight(0) + four(0) + four(20170101) + four(kNone));
  const std::string variable = record(
      8, eight(0) + four(is_float ? 21 : 22) + four(0) + eight(index) + eight(index) +
             four(matrix.packs_values ? 5 : 1) + four(0) + four(0) + four(kNone) + four(kNone) +
             four(1) + four(0) + (matrix.packs_values ? eight(kCdfCompression) : kNoOffset) +
             four(1) + matrix.name + std::string(256 - matrix.name.size(), '\0') + four(2) +
             four(matrix.rows) + four(matrix.columns) + four(kNone) + four(kNone));
  const std::string records = descriptor + global + compression + variable + values +
                              record(6, eight(0) + four(kEntries) + four(1) + entries);

  const std::string magic = four(0xCDF30001);
  if (!matrix.packs_file) return magic + four(0x0000FFFF) + records;
  const std::string packed = gzip(records);
  const std::string whole = record(
      10, eight(kCdfDescriptor + 32 + packed.size()) + eight(records.size()) + four(0) + packed);
  return magic + four(0xCCCC0001) + whole + compression;
}

}  // namespace eventgan::testing

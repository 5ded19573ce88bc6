#include "stages/base/archives/cdf_matrix.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMagicBytes = 8;
constexpr std::uint32_t kVersion3 = 0xCDF30001;
constexpr std::uint32_t kPlain = 0x0000FFFF;
constexpr std::uint32_t kCompressed = 0xCCCC0001;
constexpr std::int32_t kGzip = 5;
/// Encodings whose numbers are IEEE's, by the order of their bytes.
constexpr std::array kBigEndian{1, 2, 5, 7, 9, 11, 12, 18};
constexpr std::array kLittleEndian{4, 6, 13, 16, 17, 19};

/// Records by their numbers in a file, with the places of their fields.
enum class RecordType : std::int32_t {
  kDescriptor = 1,        // CDR: 12 GDR, 28 encoding, 32 flags
  kGlobal = 2,            // GDR: 20 first zVDR
  kIndex = 6,             // VXR: 20 entries, 24 those in use, 28 first[], last[], offset[]
  kValues = 7,            // VVR: 12 values
  kVariable = 8,          // zVDR: 12 next, 20 type, 24 last record, 28 VXR, 64 elements, 72 CPR,
                          // 84 name, 340 dimensions, 344 sizes[], varies[]
  kCompressedFile = 10,   // CCR: 12 CPR, 20 size when inflated, 32 data
  kCompression = 11,      // CPR: 12 kind
  kCompressedValues = 13  // CVVR: 16 size, 24 data
};

[[noreturn]] void refuse(const std::string& expected, const std::string& got) {
  throw std::invalid_argument("expected " + expected + ", got " + got);
}

template <class T>
T number_at(Bytes bytes, std::size_t at, std::endian order = std::endian::big) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    const std::size_t place = order == std::endian::big ? i : sizeof(T) - 1 - i;
    value = static_cast<T>(value << 8 | std::to_integer<T>(bytes[at + place]));
  }
  return value;
}

/// One of the records that a file is made of. Its fields are big-endian.
class Record {
 public:
  Record(Bytes file, std::uint64_t offset, const char* what) : what_(what) {
    constexpr std::size_t kHeader = 12;
    const Bytes rest = offset < file.size() ? file.subspan(offset) : Bytes();
    const std::uint64_t size = rest.size() < kHeader ? 0 : number_at<std::uint64_t>(rest, 0);
    if (size < kHeader || size > rest.size()) {
      refuse(what_ + " within the file",
             std::to_string(size) + " bytes at byte " + std::to_string(offset));
    }
    bytes_ = rest.first(size);
  }

  RecordType type() const { return RecordType{number(8)}; }

  const Record& of_type(RecordType type) const {
    if (this->type() != type) {
      refuse(what_, "a record of type " + std::to_string(number(8)));
    }
    return *this;
  }

  std::int32_t number(std::size_t at) const {
    return static_cast<std::int32_t>(number_at<std::uint32_t>(field(at, 4), 0));
  }
  std::uint64_t offset(std::size_t at) const { return number_at<std::uint64_t>(field(at, 8), 0); }

  Bytes field(std::size_t at, std::uint64_t size) const {
    const Bytes rest = from(at);
    if (size > rest.size()) refuse(what_ + " with all of its fields", "one cut short");
    return rest.first(size);
  }
  Bytes from(std::size_t at) const { return bytes_.subspan(std::min(at, bytes_.size())); }

 private:
  std::string what_;
  Bytes bytes_;
};

void require_gzip(Bytes file, std::uint64_t offset) {
  const std::int32_t kind =
      Record(file, offset, "a compression").of_type(RecordType::kCompression).number(12);
  if (kind != kGzip) refuse("GZIP (5) as compression", std::to_string(kind));
}

/// The `size` bytes that `packed` inflates to, behind `before` zeros. Nothing is allocated for more
/// than deflate can make of it.
std::vector<std::byte> gunzip(Bytes packed, std::uint64_t size, std::size_t before = 0) {
  const std::uint64_t most = std::min<std::uint64_t>(kMostBytes, 1032 * packed.size());
  if (size > most) {
    refuse("at most " + std::to_string(most) + " bytes of GZIP'd data", std::to_string(size));
  }
  std::vector<std::byte> bytes(before + size);
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>
      decompressor(libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  if (!decompressor ||
      libdeflate_gzip_decompress(decompressor.get(), packed.data(), packed.size(),
                                 bytes.data() + before, size, nullptr) != LIBDEFLATE_SUCCESS) {
    refuse(std::to_string(size) + " bytes of GZIP'd data with a matching checksum", "damaged data");
  }
  return bytes;
}

/// The file as it would be without compression: its records lie where their offsets say.
std::vector<std::byte> without_compression(std::vector<std::byte> file) {
  if (file.size() < kMagicBytes || number_at<std::uint32_t>(file, 0) != kVersion3) {
    refuse("a CDF file of version 3", "another");
  }
  const auto packing = number_at<std::uint32_t>(file, 4);
  if (packing == kPlain) return file;
  if (packing != kCompressed) refuse("a CDF file, compressed or not", "neither");
  const Record record =
      Record(file, kMagicBytes, "a compressed file").of_type(RecordType::kCompressedFile);
  require_gzip(file, record.offset(12));
  return gunzip(record.from(32), record.offset(20), kMagicBytes);
}

/// The variable's own record.
Record find_variable(Bytes file, std::uint64_t first, const std::string& name) {
  constexpr std::size_t kNameBytes = 256;
  std::size_t most = file.size() / kNameBytes;  // else the list goes round
  for (std::uint64_t offset = first; offset != 0;) {
    if (most-- == 0) refuse("a list of variables that ends", "one that does not");
    const Record record = Record(file, offset, "a variable").of_type(RecordType::kVariable);
    const Bytes field = record.field(84, kNameBytes);
    const auto end = std::ranges::find(field, std::byte{0});
    if (std::ranges::equal(field.first(static_cast<std::size_t>(end - field.begin())),
                           std::as_bytes(std::span(name)))) {
      return record;
    }
    offset = record.offset(12);
  }
  refuse("a variable of that name", "none");
}

/// The bytes of the variable's only record; `unpacked` holds them if they are GZIP'd.
Bytes values_of(Bytes file, const Record& variable, std::uint64_t size,
                std::vector<std::byte>& unpacked) {
  const Record index =
      Record(file, variable.offset(28), "an index of records").of_type(RecordType::kIndex);
  const std::int32_t entries = index.number(20);
  if (entries < 1 || index.number(24) != 1) {
    refuse("one entry in the index of records", std::to_string(index.number(24)));
  }
  const auto room = static_cast<std::size_t>(entries);
  const std::int32_t first = index.number(28);
  const std::int32_t last = index.number(28 + 4 * room);
  if (first != 0 || last < 0) {
    refuse("an index of record 0 and perhaps others",
           std::to_string(first) + " to " + std::to_string(last));
  }
  const Record values(file, index.offset(28 + 8 * room), "a record's values");
  // Behind the record there may be room for others, up to the index's last.
  if (values.type() != RecordType::kCompressedValues) {
    return values.of_type(RecordType::kValues).field(12, size);
  }
  require_gzip(file, variable.offset(72));
  const std::uint64_t records = static_cast<std::uint64_t>(last) + 1;
  unpacked = gunzip(values.field(24, values.offset(16)), records * size);
  return Bytes(unpacked).first(size);
}

/// Numbers of the file as those of this machine, in C order.
template <class Number, class Word>
std::vector<Number> numbers_of(Bytes bytes, std::endian order,
                               const std::vector<std::size_t>& shape, bool is_row_major) {
  const std::size_t rows = shape[0];
  const std::size_t columns = shape[1];
  std::vector<Number> numbers(rows * columns);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const std::size_t place = is_row_major ? row * columns + column : column * rows + row;
      numbers[row * columns + column] =
          std::bit_cast<Number>(number_at<Word>(bytes, sizeof(Word) * place, order));
    }
  }
  return numbers;
}

TypedArray matrix_of(Bytes file, const std::string& name) {
  const Record descriptor =
      Record(file, kMagicBytes, "a file's descriptor").of_type(RecordType::kDescriptor);
  const std::int32_t encoding = descriptor.number(28);
  const bool is_big_endian = std::ranges::find(kBigEndian, encoding) != kBigEndian.end();
  if (!is_big_endian && std::ranges::find(kLittleEndian, encoding) == kLittleEndian.end()) {
    refuse("an encoding with IEEE's numbers", std::to_string(encoding));
  }
  const std::endian order = is_big_endian ? std::endian::big : std::endian::little;
  const bool is_row_major = (descriptor.number(32) & 1) != 0;
  const Record global =
      Record(file, descriptor.offset(12), "a global descriptor").of_type(RecordType::kGlobal);
  const Record variable = find_variable(file, global.offset(20), name);

  const std::int32_t type = variable.number(20);
  const bool is_float = type == 21 || type == 44;  // CDF_REAL4, CDF_FLOAT
  if (!is_float && type != 22 && type != 45) {     // CDF_REAL8, CDF_DOUBLE
    refuse("float or double", "type " + std::to_string(type));
  }
  if (variable.number(24) != 0) {
    refuse("one record", std::to_string(std::int64_t{variable.number(24)} + 1));
  }
  if (variable.number(340) != 2) {
    refuse("two dimensions", std::to_string(variable.number(340)));
  }
  if (variable.number(352) == 0 || variable.number(356) == 0) {
    refuse("dimensions that vary", "one that does not");
  }
  const std::int32_t rows = variable.number(344);
  const std::int32_t columns = variable.number(348);
  const std::uint64_t width = is_float ? 4 : 8;
  if (rows < 1 || columns < 1 ||
      static_cast<std::uint64_t>(rows) > kMostBytes / width / static_cast<std::uint64_t>(columns)) {
    refuse("a matrix of at most " + std::to_string(kMostBytes) + " bytes",
           std::to_string(rows) + " x " + std::to_string(columns) + " numbers");
  }
  const std::vector shape{static_cast<std::size_t>(rows), static_cast<std::size_t>(columns)};
  std::vector<std::byte> unpacked;
  const Bytes bytes = values_of(file, variable, shape[0] * shape[1] * width, unpacked);
  if (is_float) {
    return {shape, numbers_of<float, std::uint32_t>(bytes, order, shape, is_row_major)};
  }
  return {shape, numbers_of<double, std::uint64_t>(bytes, order, shape, is_row_major)};
}

}  // namespace

TypedArray read_cdf_matrix(const std::filesystem::path& file, const std::string& variable) try {
  const InputFile content(file);
  if (content.size_bytes() > kMostBytes) {
    refuse("a file of at most " + std::to_string(kMostBytes) + " bytes",
           std::to_string(content.size_bytes()));
  }
  return matrix_of(without_compression(content.read_bytes(0, content.size_bytes())), variable);
} catch (const std::invalid_argument& error) {
  throw std::runtime_error(std::string(error.what()) + ", in " + file.string() + " (" + variable +
                           ")");
}

}  // namespace eventgan

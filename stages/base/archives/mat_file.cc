#include "stages/base/archives/mat_file.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"

namespace eventgan {
namespace {

constexpr std::size_t kHeaderBytes = 128;
constexpr std::size_t kTagBytes = 8;
constexpr std::uint32_t kMatrix = 14;             // miMATRIX
constexpr std::uint32_t kCompressedElement = 15;  // miCOMPRESSED
constexpr std::size_t kMostInflated = std::size_t{1} << 30;
constexpr std::size_t kMostMatDimensions = 8;
constexpr std::size_t kLongestField = 64;  // MATLAB's own limit is 63, and a zero ends it

[[noreturn]] void refuse_mat(const std::string& expected, const std::string& got) {
  throw std::invalid_argument("expected " + expected + ", got " + got);
}

std::uint32_t number_at(std::string_view bytes, std::size_t at, bool little) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value = value << 8 | static_cast<unsigned char>(bytes[at + (little ? 3 - i : i)]);
  }
  return value;
}

/// A tagged piece of a file.
struct Element {
  std::uint32_t type = 0;
  std::string_view data;
};

/// The elements that follow one another in `bytes`.
class Elements {
 public:
  Elements(std::string_view bytes, bool little) : rest_(bytes), little_(little) {}

  bool at_end() const { return rest_.empty(); }

  Element next(const char* what) {
    if (rest_.size() < kTagBytes) refuse_mat(std::string("a tag for ") + what, "the array's end");
    const std::uint32_t first = number_at(rest_, 0, little_);
    if (const std::size_t size = first >> 16; size != 0) {  // up to four bytes lie in the tag
      if (size > 4) refuse_mat("at most 4 bytes in a tag", std::to_string(size));
      const Element small{first & 0xffff, rest_.substr(4, size)};
      rest_.remove_prefix(kTagBytes);
      return small;
    }
    const std::size_t size = number_at(rest_, 4, little_);
    rest_.remove_prefix(kTagBytes);
    if (size > rest_.size()) {
      refuse_mat(std::to_string(size) + " bytes of " + what, std::to_string(rest_.size()));
    }
    const Element element{first, rest_.substr(0, size)};
    const bool is_padded = first != kMatrix && first != kCompressedElement;
    const std::size_t padding = is_padded ? (8 - size % 8) % 8 : 0;
    rest_.remove_prefix(std::min(size + padding, rest_.size()));
    return element;
  }

  Element next(const char* what, std::uint32_t type) {
    const Element element = next(what);
    if (element.type != type) {
      refuse_mat(std::string(what) + " of type " + std::to_string(type),
                 std::to_string(element.type));
    }
    return element;
  }

 private:
  std::string_view rest_;
  bool little_;
};

/// Bytes of one number; 0 if the type is none of numbers.
std::size_t width_of(std::uint32_t stored) {
  switch (stored) {
    case MatArray::kStoredInt8:
    case MatArray::kStoredUint8:
      return 1;
    case MatArray::kStoredInt16:
    case MatArray::kStoredUint16:
      return 2;
    case MatArray::kStoredInt32:
    case MatArray::kStoredUint32:
    case MatArray::kStoredSingle:
      return 4;
    case MatArray::kStoredDouble:
    case MatArray::kStoredInt64:
    case MatArray::kStoredUint64:
      return 8;
    default:
      return 0;
  }
}

std::vector<std::size_t> read_dimensions(std::string_view data, bool little) {
  const std::size_t count = data.size() / 4;
  if (data.size() % 4 != 0 || count < 2 || count > kMostMatDimensions) {
    refuse_mat("2 to " + std::to_string(kMostMatDimensions) + " dimensions of 4 bytes",
               std::to_string(data.size()) + " bytes");
  }
  std::vector<std::size_t> dims;
  for (std::size_t i = 0; i < count; ++i) dims.push_back(number_at(data, 4 * i, little));
  return dims;
}

std::size_t product(const std::vector<std::size_t>& dims) {
  if (std::ranges::find(dims, std::size_t{0}) != dims.end()) return 0;
  std::size_t size = 1;
  for (const std::size_t dim : dims) {
    if (dim > std::numeric_limits<std::uint32_t>::max() / size)
      refuse_mat("dimensions", "too large ones");
    size *= dim;
  }
  return size;
}

void read_numbers(Elements& elements, MatArray& array) {
  if (array.size == 0 && elements.at_end()) return;
  for (int part = 0; part < (array.is_complex ? 2 : 1); ++part) {
    const Element element = elements.next("numbers");
    const std::size_t width = width_of(element.type);
    if (width == 0 || element.data.size() != array.size * width) {
      refuse_mat(
          std::to_string(array.size) + " numbers",
          std::to_string(element.data.size()) + " bytes of type " + std::to_string(element.type));
    }
    if (part > 0) continue;  // imaginary parts are looked at by nobody
    array.stored = element.type;
    array.data = element.data;
  }
}

void read_text(Elements& elements, MatArray& array) {
  if (array.size == 0 && elements.at_end()) return;
  const Element element = elements.next("text");
  const std::size_t bytes = element.data.size();
  bool fits = false;
  switch (element.type) {
    case MatArray::kStoredInt8:
    case MatArray::kStoredUint8:
      fits = bytes == array.size;
      break;
    case MatArray::kStoredUint16:
    case MatArray::kStoredUtf16:
      fits = bytes == 2 * array.size;
      break;
    case MatArray::kStoredUtf8:  // a character takes one byte to four
      fits = bytes >= array.size && bytes <= 4 * array.size;
      break;
    default:
      break;
  }
  if (!fits) {
    refuse_mat(std::to_string(array.size) + " characters in UTF-8 or UTF-16",
               std::to_string(bytes) + " bytes of type " + std::to_string(element.type));
  }
  array.stored = element.type;
  array.data = element.data;
}

void read_field_names(Elements& elements, MatArray& array) {
  const Element length = elements.next("a field name's length", MatArray::kStoredInt32);
  if (length.data.size() != 4) refuse_mat("a field name's length", "another element");
  const std::size_t width = number_at(length.data, 0, array.is_little_endian);
  const std::string_view names = elements.next("field names", MatArray::kStoredInt8).data;
  if (width == 0 || width > kLongestField || names.size() % width != 0) {
    refuse_mat("field names of at most " + std::to_string(kLongestField) + " bytes",
               std::to_string(names.size()) + " bytes, " + std::to_string(width) + " for each");
  }
  for (std::size_t at = 0; at < names.size(); at += width) {
    const std::string_view name = names.substr(at, width);
    array.fields.emplace_back(name.substr(0, name.find('\0')));
  }
  if (std::set<std::string>(array.fields.begin(), array.fields.end()).size() !=
      array.fields.size()) {
    refuse_mat("each field once", "one twice");
  }
}

void read_arrays(Elements& elements, std::size_t count, MatArray& array) {
  while (!elements.at_end()) array.arrays.push_back(elements.next("an array", kMatrix).data);
  if (array.arrays.size() != count) {
    refuse_mat(std::to_string(count) + " arrays", std::to_string(array.arrays.size()));
  }
}

/// The inflated bytes of a zlib stream, which zlib compares with the checksum at its end: an array
/// with its tag. None if stream, sum or size is wrong. Throws std::invalid_argument if the array is
/// too large.
std::optional<std::string> inflated(std::string_view stream, bool little) {
  z_stream state{};
  if (inflateInit(&state) != Z_OK) return std::nullopt;
  state.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream.data()));
  state.avail_in = static_cast<uInt>(stream.size());
  std::string bytes;
  std::vector<char> block(1 << 18);
  std::size_t told = kMostInflated;  // the array says first how long it is
  int status = Z_OK;
  while (status == Z_OK && told <= kMostInflated && bytes.size() <= kTagBytes + told) {
    state.next_out = reinterpret_cast<Bytef*>(block.data());
    state.avail_out = static_cast<uInt>(block.size());
    status = inflate(&state, Z_NO_FLUSH);
    bytes.append(block.data(), block.size() - state.avail_out);
    if (bytes.size() >= kTagBytes) told = number_at(bytes, 4, little);
  }
  inflateEnd(&state);
  if (told > kMostInflated) {
    refuse_mat("at most " + std::to_string(kMostInflated) + " bytes in a compressed array",
               std::to_string(told));
  }
  if (status != Z_STREAM_END || state.avail_in > 0 || bytes.size() != kTagBytes + told) {
    return std::nullopt;
  }
  return bytes;
}

/// Finds the variable `name`; `bytes` is the whole file. Null `bytes` in the answer: there is none.
MatVariable find_variable(const std::shared_ptr<const std::string>& file, const std::string& name) {
  const std::string_view bytes = *file;
  const std::string_view mark = bytes.size() < kHeaderBytes ? "" : bytes.substr(126, 2);
  const bool little = mark == "IM";
  const int version = little || mark == "MI" ? bytes[little ? 125 : 124] : 0;
  if (version != 1) {
    refuse_mat("a MATLAB version 5 file (saved with -v7 or -v6)",
               version == 2 ? "version 7.3" : "something else");
  }
  MatVariable found;
  for (std::size_t at = kHeaderBytes; at < bytes.size();) {
    const std::string_view rest = bytes.substr(at);
    const bool has_tag = rest.size() >= kTagBytes;
    const std::size_t size = has_tag ? number_at(rest, 4, little) : 0;
    if (!has_tag || size > rest.size() - kTagBytes) {
      refuse_mat("a whole file", "one cut off at byte " + std::to_string(bytes.size()));
    }
    const std::uint32_t type = number_at(rest, 0, little);
    std::shared_ptr<const std::string> owner = file;
    std::string_view content = rest.substr(kTagBytes, size);
    if (type == kCompressedElement) {
      auto inner = inflated(content, little);
      if (!inner || number_at(*inner, 0, little) != kMatrix) {
        refuse_mat("a compressed array with a matching checksum",
                   "damaged data at byte " + std::to_string(at));
      }
      owner = std::make_shared<const std::string>(*std::move(inner));
      content = std::string_view(*owner).substr(kTagBytes);
    } else if (type != kMatrix) {
      refuse_mat("an array", "type " + std::to_string(type) + " at byte " + std::to_string(at));
    }
    if (!found.bytes) {
      MatArray array = parse_mat_array(content, little);
      if (array.name == name) found = {std::move(owner), std::move(array)};
    }
    at += kTagBytes + size;
  }
  return found;
}

}  // namespace

MatArray parse_mat_array(std::string_view bytes, bool is_little_endian) {
  MatArray array;
  array.is_little_endian = is_little_endian;
  array.dims = {0, 0};
  if (bytes.empty()) return array;  // how MATLAB writes [] in some places
  Elements elements(bytes, is_little_endian);
  const std::string_view flags = elements.next("array flags", MatArray::kStoredUint32).data;
  if (flags.size() != 8) refuse_mat("8 bytes of array flags", std::to_string(flags.size()));
  const std::uint32_t bits = number_at(flags, 0, is_little_endian);
  array.class_code = static_cast<int>(bits & 0xff);
  array.is_complex = (bits & 0x800) != 0;
  array.is_logical = (bits & 0x200) != 0;
  const bool is_number =
      array.class_code >= MatArray::kDouble && array.class_code <= MatArray::kUint64;
  if (!is_number && array.class_code != MatArray::kCell && array.class_code != MatArray::kStruct &&
      array.class_code != MatArray::kChar) {
    return array;
  }
  array.dims =
      read_dimensions(elements.next("dimensions", MatArray::kStoredInt32).data, is_little_endian);
  array.size = product(array.dims);
  array.name = elements.next("a name", MatArray::kStoredInt8).data;
  if (is_number) {
    read_numbers(elements, array);
  } else if (array.class_code == MatArray::kChar) {
    read_text(elements, array);
  } else if (array.class_code == MatArray::kCell) {
    read_arrays(elements, array.size, array);
  } else {
    read_field_names(elements, array);
    if (array.fields.empty() && array.size > 1) refuse_mat("fields in a struct array", "none");
    read_arrays(elements, array.size * array.fields.size(), array);
  }
  if (!elements.at_end()) refuse_mat("an array's end", "more");
  return array;
}

MatVariable read_mat_variable(const std::filesystem::path& file, const std::string& name) try {
  std::string reason;
  auto bytes = try_read_file(file, reason);
  if (!bytes) refuse_mat("a MATLAB file", "nothing readable (" + reason + ")");
  MatVariable variable =
      find_variable(std::make_shared<const std::string>(*std::move(bytes)), name);
  if (!variable.bytes) refuse_mat("a variable " + name, "none");
  return variable;
} catch (const std::invalid_argument& error) {
  throw InputError(std::string(error.what()) + ", in " + file.string());
}

}  // namespace eventgan

#include "stages/base/archives/numpy_arrays.h"

#include <fmt/core.h>
#include <utf8.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "stages/base/archives/numpy_layout.h"

namespace eventgan {
namespace {

static_assert(std::endian::native == std::endian::little, "numpy's '<' is copied as it is");

constexpr std::size_t kMostDimensions = 32;  // numpy's own limit

std::optional<std::size_t> product(std::size_t a, std::size_t b) {
  if (a != 0 && b > std::numeric_limits<std::size_t>::max() / a) return std::nullopt;
  return a * b;
}

// Element k of the result is element order[k] of the data: the identity, or the way from Fortran's
// order (first index fastest) into C's.
std::vector<std::size_t> c_order(const std::vector<std::size_t>& shape, std::size_t count) {
  std::vector<std::size_t> strides(shape.size(), 1);
  for (std::size_t d = 1; d < shape.size(); ++d) strides[d] = strides[d - 1] * shape[d - 1];
  std::vector<std::size_t> index(shape.size(), 0);
  std::vector<std::size_t> order(count);
  std::size_t offset = 0;
  for (std::size_t k = 0; k < count; ++k) {
    order[k] = offset;
    for (std::size_t d = shape.size(); d-- > 0;) {
      offset += strides[d];
      if (++index[d] < shape[d]) break;
      offset -= strides[d] * shape[d];
      index[d] = 0;
    }
  }
  return order;
}

template <class T>
std::vector<T> copy_numbers(std::span<const std::byte> data) {
  std::vector<T> values(data.size() / sizeof(T));
  if (!data.empty()) std::memcpy(values.data(), data.data(), data.size());
  return values;
}

/// Of a type that is not kept as it is.
template <class Stored, class Kept>
std::vector<Kept> widen_numbers(std::span<const std::byte> data, const std::string& name) {
  const std::vector<Stored> stored = copy_numbers<Stored>(data);
  std::vector<Kept> values(stored.size());
  for (std::size_t i = 0; i < stored.size(); ++i) {
    if (!std::in_range<Kept>(stored[i])) {
      refuse_numpy("numbers below 2^63", std::to_string(stored[i]), name);
    }
    values[i] = static_cast<Kept>(stored[i]);
  }
  return values;
}

std::string utf32_text(std::span<const std::byte> element, const std::string& name) {
  std::string text;
  std::size_t end = element.size();
  while (end >= 4 && element[end - 1] == std::byte{0} && element[end - 2] == std::byte{0} &&
         element[end - 3] == std::byte{0} && element[end - 4] == std::byte{0}) {
    end -= 4;  // padding
  }
  for (std::size_t i = 0; i < end; i += 4) {
    std::uint32_t code = 0;
    std::memcpy(&code, element.data() + i, sizeof(code));
    try {
      utf8::append(char32_t{code}, text);
    } catch (const utf8::invalid_code_point&) {
      refuse_numpy("Unicode text", "code point " + std::to_string(code), name);
    }
  }
  return text;
}

std::string byte_text(std::span<const std::byte> element, const std::string& name) {
  std::string text(reinterpret_cast<const char*>(element.data()), element.size());
  text.resize(text.find_last_not_of('\0') + 1);
  if (!utf8::is_valid(text)) refuse_numpy("ASCII or UTF-8 text", "other bytes", name);
  return text;
}

std::vector<std::string> copy_text(std::span<const std::byte> data, std::size_t item_size,
                                   bool unicode, const std::string& name) {
  std::vector<std::string> values;
  if (item_size == 0) return values;
  values.reserve(data.size() / item_size);
  for (std::size_t at = 0; at < data.size(); at += item_size) {
    const auto element = data.subspan(at, item_size);
    values.push_back(unicode ? utf32_text(element, name) : byte_text(element, name));
  }
  return values;
}

// Size of one element in bytes; none if the dtype is not one of ours.
std::optional<std::size_t> item_size_of(std::string_view descr) {
  if (descr == "|u1" || descr == "|b1" || descr == "|i1") return 1;
  if (descr == "<u2" || descr == "<i2") return 2;
  if (descr == "<f4" || descr == "<i4" || descr == "<u4") return 4;
  if (descr == "<f8" || descr == "<i8" || descr == "<u8") return 8;
  const bool unicode = descr.starts_with("<U");
  if (!unicode && !descr.starts_with("|S")) return std::nullopt;
  std::uint32_t length = 0;
  const char* end = descr.data() + descr.size();
  const auto [stop, error] = std::from_chars(descr.data() + 2, end, length);
  if (error != std::errc() || stop != end) return std::nullopt;
  return std::size_t{length} * (unicode ? 4 : 1);
}

}  // namespace

void refuse_numpy(const std::string& expected, std::string got, const std::string& name) {
  std::ranges::replace_if(
      got, [](char c) { return c < ' ' || c > '~'; }, '?');
  throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name);
}

std::size_t require_numpy_size(const NumpyLayout& layout, std::uint64_t size_bytes,
                               const std::string& name) {
  if (!layout.fields.empty()) {
    refuse_numpy("an array of numbers or text", "one of fields (a structured dtype)", name);
  }
  const std::string& descr = layout.descr;
  if (descr.find('O') != std::string::npos) {
    refuse_numpy("an array of numbers or text", "Python objects (dtype '" + descr + "')", name);
  }
  const auto item_size = item_size_of(descr);
  if (!item_size) {
    refuse_numpy("dtype <f4, <f8, <i, <u, |b1, <U or |S", "'" + descr + "'", name);
  }
  if (layout.shape.size() > kMostDimensions) {
    refuse_numpy("at most 32 dimensions", std::to_string(layout.shape.size()), name);
  }
  std::optional<std::size_t> needed = item_size;
  for (const std::size_t size : layout.shape) {
    if (needed) needed = product(*needed, size);
  }
  if (needed != size_bytes) {
    refuse_numpy((needed ? std::to_string(*needed) : "countless") + " bytes for shape " +
                     TypedArray{.shape = layout.shape, .values = {}}.shape_text() + " of " + descr,
                 std::to_string(size_bytes), name);
  }
  if (*item_size == 0) {
    // Elements without bytes: their number could not be checked against the input.
    const bool empty = std::ranges::find(layout.shape, 0u) != layout.shape.end();
    if (!empty) refuse_numpy("text of at least one character", "'" + descr + "'", name);
  }
  return *item_size;
}

TypedArray decode_numpy_elements(const NumpyLayout& layout, std::span<const std::byte> data,
                                 const std::string& name) {
  const std::size_t item_size = require_numpy_size(layout, data.size(), name);
  const std::string& descr = layout.descr;
  TypedArray array{.shape = layout.shape, .values = {}};
  if (descr == "<f8") {
    array.values = copy_numbers<double>(data);
  } else if (descr == "<f4") {
    array.values = copy_numbers<float>(data);
  } else if (descr == "<i8") {
    array.values = copy_numbers<std::int64_t>(data);
  } else if (descr == "<i4") {
    array.values = copy_numbers<std::int32_t>(data);
  } else if (descr == "|u1") {
    array.values = copy_numbers<std::uint8_t>(data);
  } else if (descr == "|i1") {
    array.values = widen_numbers<std::int8_t, std::int32_t>(data, name);
  } else if (descr == "<i2") {
    array.values = widen_numbers<std::int16_t, std::int32_t>(data, name);
  } else if (descr == "<u2") {
    array.values = widen_numbers<std::uint16_t, std::int32_t>(data, name);
  } else if (descr == "<u4") {
    array.values = widen_numbers<std::uint32_t, std::int64_t>(data, name);
  } else if (descr == "<u8") {
    array.values = widen_numbers<std::uint64_t, std::int64_t>(data, name);
  } else if (descr == "|b1") {
    std::vector<bool> values(data.size());
    for (std::size_t i = 0; i < data.size(); ++i) values[i] = data[i] != std::byte{0};
    array.values = std::move(values);
  } else {
    array.values = copy_text(data, item_size, descr[1] == 'U', name);
  }

  if (layout.fortran_order && array.shape.size() > 1) {
    const auto order = c_order(array.shape, array.size());
    std::visit(
        [&](auto& elements) {
          auto sorted = elements;
          for (std::size_t k = 0; k < order.size(); ++k) sorted[k] = elements[order[k]];
          elements = std::move(sorted);
        },
        array.values);
  }
  return array;
}

namespace {

// The header is a Python dictionary of exactly the keys descr, fortran_order and shape. This reads
// that and no other Python.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  NumpyLayout read() {
    std::optional<NumpyLayout> type;
    std::optional<bool> fortran_order;
    std::optional<std::vector<std::size_t>> shape;
    need("{");
    while (!take("}")) {
      const std::string key = quoted();
      need(":");
      if (key == "descr" && !type) {
        type = NumpyLayout();
        if (take("[")) {
          type->fields = fields();
        } else {
          type->descr = quoted();
        }
      } else if (key == "fortran_order" && !fortran_order) {
        fortran_order = truth();
      } else if (key == "shape" && !shape) {
        shape = tuple();
      } else {
        fail("the keys descr, fortran_order and shape, once each");
      }
      if (!take(",")) {
        need("}");
        break;
      }
    }
    skip_spaces();
    if (!text_.empty()) fail("nothing after the header's dictionary");
    if (!type || !fortran_order || !shape) fail("the keys descr, fortran_order and shape");
    type->fortran_order = *fortran_order;
    type->shape = *shape;
    return *type;
  }

 private:
  [[noreturn]] void fail(const std::string& expected) const {
    const std::string rest =
        text_.empty() ? "its end" : "\"" + std::string(text_.substr(0, 40)) + "\"";
    refuse_numpy(expected + " in the .npy header", rest, name_);
  }

  void skip_spaces() {
    text_.remove_prefix(std::min(text_.find_first_not_of(" \n"), text_.size()));
  }

  bool take(std::string_view token) {
    skip_spaces();
    if (!text_.starts_with(token)) return false;
    text_.remove_prefix(token.size());
    return true;
  }

  void need(std::string_view token) {
    if (!take(token)) fail("\"" + std::string(token) + "\"");
  }

  std::string quoted() {
    const std::string_view quote = take("'") ? "'" : "\"";
    if (quote == "\"") need(quote);
    const std::size_t end = text_.find(quote);
    if (end == std::string_view::npos) fail("a closing quote");
    const std::string value(text_.substr(0, end));
    text_.remove_prefix(end + 1);
    return value;
  }

  /// Of a structured dtype: ('x', '<f4'), and no arrays or fields in fields.
  std::vector<NumpyField> fields() {
    std::vector<NumpyField> fields;
    while (!take("]")) {
      need("(");
      NumpyField field;
      field.name = quoted();
      need(",");
      field.descr = quoted();
      need(")");
      const bool is_known =
          !field.name.empty() &&
          std::ranges::find(fields, field.name, &NumpyField::name) != fields.end();
      if (is_known) fail("each field once");
      fields.push_back(std::move(field));
      if (!take(",")) {
        need("]");
        break;
      }
    }
    if (fields.empty()) fail("a field");
    return fields;
  }

  bool truth() {
    if (take("True")) return true;
    need("False");
    return false;
  }

  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> sizes;
    need("(");
    while (!take(")")) {
      skip_spaces();
      std::size_t size = 0;
      const auto [stop, error] = std::from_chars(text_.data(), text_.data() + text_.size(), size);
      if (error != std::errc()) fail("a dimension");
      text_.remove_prefix(static_cast<std::size_t>(stop - text_.data()));
      take("L");  // Python 2 wrote long integers so
      sizes.push_back(size);
      if (!take(",")) {
        if (sizes.size() == 1) fail("\",\" after a single dimension");
        need(")");
        break;
      }
    }
    return sizes;
  }

  std::string_view text_;
  const std::string& name_;
};

constexpr std::string_view kMagic = "\x93NUMPY";

}  // namespace

NumpyLayout parse_npy_header(std::span<const std::byte> bytes, const std::string& name,
                             std::size_t& data_begin) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with(kMagic) || text.size() < 8) {
    refuse_numpy("a .npy file", std::to_string(text.size()) + " bytes without its magic", name);
  }
  const int version = std::to_integer<int>(bytes[6]);
  if (version < 1 || version > 3) refuse_numpy(".npy version 1-3", std::to_string(version), name);
  // After the magic and two bytes of version: the header's length, 2 bytes in version 1, 4 later.
  const std::size_t start = version == 1 ? 10 : 12;
  if (text.size() < start) refuse_numpy("a .npy header", "the end of the file", name);
  std::size_t length = 0;
  for (std::size_t i = start; i-- > 8;)
    length = length << 8 | std::to_integer<std::size_t>(bytes[i]);
  if (length > text.size() - start) {
    refuse_numpy("a .npy header of " + std::to_string(length) + " bytes",
                 std::to_string(text.size() - start), name);
  }
  data_begin = start + length;
  return HeaderReader(text.substr(start, length), name).read();
}

TypedArray parse_npy(std::span<const std::byte> bytes, const std::string& name) {
  std::size_t begin = 0;
  const NumpyLayout layout = parse_npy_header(bytes, name, begin);
  return decode_numpy_elements(layout, bytes.subspan(begin), name);
}

std::vector<NamedArray> parse_npy_fields(std::span<const std::byte> bytes,
                                         const std::string& name) {
  std::size_t begin = 0;
  const NumpyLayout layout = parse_npy_header(bytes, name, begin);
  if (layout.fields.empty() || layout.shape.size() != 1) {
    refuse_numpy("a structured array [N]",
                 layout.fields.empty() ? "'" + layout.descr + "'"
                                       : std::to_string(layout.shape.size()) + " dimensions",
                 name);
  }
  const std::span<const std::byte> data = bytes.subspan(begin);
  std::vector<std::size_t> sizes;
  std::size_t row = 0;
  for (const NumpyField& field : layout.fields) {
    std::string descr = field.descr;
    if (field.name.empty() && descr.starts_with("|V")) descr[1] = 'S';
    const auto size = item_size_of(descr);
    if (!size) refuse_numpy("a field of numbers or text", "'" + field.descr + "'", name);
    sizes.push_back(*size);
    row += *size;
  }
  const std::size_t count = layout.shape[0];
  if (product(row, count) != data.size()) {
    refuse_numpy(std::to_string(count) + " rows of " + std::to_string(row) + " bytes",
                 std::to_string(data.size()) + " bytes", name);
  }
  std::vector<NamedArray> arrays;
  std::size_t offset = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (!layout.fields[i].name.empty()) {
      std::vector<std::byte> column(sizes[i] * count);
      for (std::size_t k = 0; k < count; ++k) {
        std::ranges::copy(data.subspan(k * row + offset, sizes[i]), column.begin() + k * sizes[i]);
      }
      arrays.push_back({layout.fields[i].name,
                        decode_numpy_elements({layout.fields[i].descr, false, {count}}, column,
                                              name + " (" + layout.fields[i].name + ")")});
    }
    offset += sizes[i];
  }
  return arrays;
}

namespace {

/// `descr` as Python writes it.
std::string npy_bytes(std::string_view descr, const std::vector<std::size_t>& shape,
                      std::size_t item_bytes, std::string_view values) {
  const std::size_t count =
      std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
  if (values.size() != count * item_bytes) {
    throw std::invalid_argument(
        fmt::format("expected {} bytes of an array, got {}", count * item_bytes, values.size()));
  }
  std::string sides;
  for (const std::size_t side : shape) sides += std::to_string(side) + ", ";
  if (shape.size() > 1) sides.erase(sides.size() - 2);
  if (shape.size() == 1) sides.pop_back();  // "(4,)"
  std::string header =
      fmt::format("{{'descr': {}, 'fortran_order': False, 'shape': ({}), }}", descr, sides);
  constexpr std::size_t kPreamble = 10;
  constexpr std::size_t kAlignment = 64;
  header.append(kAlignment - 1 - (kPreamble + header.size()) % kAlignment, ' ');
  header += '\n';
  std::string file(kMagic);
  file += {'\x01', '\x00'};
  file += static_cast<char>(header.size() & 0xff);
  file += static_cast<char>(header.size() >> 8);
  file += header;
  return file.append(values);
}

}  // namespace

std::string npy_file(std::string_view dtype, const std::vector<std::size_t>& shape,
                     std::span<const std::byte> values) {
  std::size_t item_bytes = 0;
  std::from_chars(dtype.data() + 2, dtype.data() + dtype.size(), item_bytes);
  if (dtype[1] == 'U') item_bytes *= sizeof(char32_t);
  return npy_bytes(fmt::format("'{}'", dtype), shape, item_bytes,
                   {reinterpret_cast<const char*>(values.data()), values.size()});
}

std::string npy_records(std::string_view descr, std::size_t record_bytes, std::string_view values) {
  return npy_bytes(descr, {values.size() / record_bytes}, record_bytes, values);
}

std::string npy_texts(const std::vector<std::string>& texts) {
  std::vector<std::u32string> wide;
  std::size_t longest = 1;
  for (const std::string& text : texts) {
    std::string sound;
    utf8::replace_invalid(text.begin(), text.end(), std::back_inserter(sound));
    wide.emplace_back();
    utf8::utf8to32(sound.begin(), sound.end(), std::back_inserter(wide.back()));
    longest = std::max(longest, wide.back().size());
  }
  std::vector<char32_t> values;
  for (std::u32string& text : wide) {
    text.resize(longest, U'\0');
    values.insert(values.end(), text.begin(), text.end());
  }
  return npy_file(fmt::format("<U{}", longest), {texts.size()}, values);
}

namespace {

using Kind = PickleNode::Kind;

[[noreturn]] void fail(const std::string& expected, const std::string& got,
                       const std::string& name) {
  throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name);
}

bool is_text(const PickleNode& node) {
  return node.kind == Kind::kString || node.kind == Kind::kBytes;
}

// The state that numpy's classes pickle: a tuple of at least `count` items.
const std::vector<const PickleNode*>& state_of(const PickleNode& node, std::size_t count,
                                               const char* what, const std::string& name) {
  if (node.state == nullptr || node.state->kind != Kind::kTuple ||
      node.state->items.size() < count) {
    fail(std::string("the state of a ") + what,
         node.state == nullptr ? "none" : describe(node.state->kind), name);
  }
  return node.state->items;
}

bool is_call_of(const PickleNode& node, const std::set<std::string>& names) {
  return node.kind == Kind::kCall && names.contains(node.items[0]->text);
}

// dtype("f8", align, copy) with the state (version, byte order, ...).
std::string descr_of(const PickleNode& dtype, const std::string& name) {
  if (!is_call_of(dtype, {"numpy.dtype"}) || dtype.items[1]->items.empty() ||
      !is_text(*dtype.items[1]->items[0])) {
    fail("a numpy dtype", describe(dtype.kind), name);
  }
  const PickleNode& order = *state_of(dtype, 2, "numpy dtype", name)[1];
  if (!is_text(order)) fail("a byte order", describe(order.kind), name);
  return order.text + dtype.items[1]->items[0]->text;
}

// Python 3 writes bytes for Python 2 as a call: _codecs.encode(text, "latin1").
std::string latin1_bytes(const std::string& utf8, const std::string& name) {
  std::string bytes;
  for (std::size_t i = 0; i < utf8.size(); ++i) {
    const auto lead = static_cast<unsigned char>(utf8[i]);
    if (lead < 0x80) {
      bytes += utf8[i];
    } else if (lead <=
               0xc3) {  // two bytes of UTF-8 reach U+00FF; the pickle reader checked the form
      bytes +=
          static_cast<char>((lead & 0x03) << 6 | (static_cast<unsigned char>(utf8[++i]) & 0x3f));
    } else {
      fail("Latin-1 text", "other characters", name);
    }
  }
  return bytes;
}

std::string bytes_of(const PickleNode& node, const std::string& name) {
  if (node.kind == Kind::kBytes) return node.text;
  if (is_call_of(node, {"_codecs.encode"})) {
    const auto& arguments = node.items[1]->items;
    if (arguments.size() == 2 && arguments[0]->kind == Kind::kString && is_text(*arguments[1]) &&
        arguments[1]->text == "latin1") {
      return latin1_bytes(arguments[0]->text, name);
    }
  }
  fail("the bytes of an array", describe(node.kind), name);
}

}  // namespace

const std::set<std::string>& numpy_globals() {
  static const std::set<std::string> kNames = {
      "_codecs.encode", "numpy._core.multiarray._reconstruct", "numpy.core.multiarray._reconstruct",
      "numpy.dtype", "numpy.ndarray"};
  return kNames;
}

bool is_pickled_array(const PickleNode& node) {
  return is_call_of(node,
                    {"numpy._core.multiarray._reconstruct", "numpy.core.multiarray._reconstruct"});
}

TypedArray parse_pickled_array(const PickleNode& node, const std::string& name) {
  if (!is_pickled_array(node)) fail("a numpy array", describe(node.kind), name);
  // (version, shape, dtype, is Fortran order, bytes)
  const auto& state = state_of(node, 5, "numpy array", name);
  const PickleNode& shape = *state[1];
  if (shape.kind != Kind::kTuple) fail("a shape", describe(shape.kind), name);
  NumpyLayout layout;
  for (const PickleNode* size : shape.items) {
    if (size->kind != Kind::kInt || size->integer < 0) {
      fail("dimensions of at least 0", describe(size->kind), name);
    }
    layout.shape.push_back(static_cast<std::size_t>(size->integer));
  }
  layout.descr = descr_of(*state[2], name);
  if (state[3]->kind != Kind::kBool) fail("an order flag", describe(state[3]->kind), name);
  layout.fortran_order = state[3]->integer != 0;
  const std::string bytes = bytes_of(*state[4], name);
  return decode_numpy_elements(layout, std::as_bytes(std::span(bytes)), name);
}

}  // namespace eventgan

#include "stages/archives/npy_array.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "stages/archives/numpy_elements_internal.h"

namespace eventgan {
namespace {

// The header is a Python dictionary of exactly the keys descr, fortran_order and shape. This reads
// that and no other Python.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  NumpyLayout read() {
    std::optional<std::string> descr;
    std::optional<bool> fortran_order;
    std::optional<std::vector<std::size_t>> shape;
    need("{");
    while (!take("}")) {
      const std::string key = quoted();
      need(":");
      if (key == "descr" && !descr) {
        descr = quoted();
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
    if (!descr || !fortran_order || !shape) fail("the keys descr, fortran_order and shape");
    return {*descr, *fortran_order, *shape};
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
    if (quote == "\"") need(quote);  // structured dtypes, which are lists, end here
    const std::size_t end = text_.find(quote);
    if (end == std::string_view::npos) fail("a closing quote");
    const std::string value(text_.substr(0, end));
    text_.remove_prefix(end + 1);
    return value;
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

}  // namespace

TypedArray parse_npy(std::span<const std::byte> bytes, const std::string& name) {
  constexpr std::string_view kMagic = "\x93NUMPY";
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
  const NumpyLayout layout = HeaderReader(text.substr(start, length), name).read();
  return decode_numpy_elements(layout, bytes.subspan(start + length), name);
}

}  // namespace eventgan

#include <cstddef>

#include "stages/archives/utf8_internal.h"

namespace eventgan {
namespace {

bool is_code_point(char32_t code) {
  return code <= 0x10ffff && !(code >= 0xd800 && code <= 0xdfff);
}

}  // namespace

bool append_utf8(char32_t code, std::string& text) {
  if (!is_code_point(code)) return false;
  const auto put = [&](char32_t bits) { text += static_cast<char>(bits); };
  const auto put_tail = [&](int shift) { put(0x80 | ((code >> shift) & 0x3f)); };
  if (code < 0x80) {
    put(code);
  } else if (code < 0x800) {
    put(0xc0 | (code >> 6));
    put_tail(0);
  } else if (code < 0x10000) {
    put(0xe0 | (code >> 12));
    put_tail(6);
    put_tail(0);
  } else {
    put(0xf0 | (code >> 18));
    put_tail(12);
    put_tail(6);
    put_tail(0);
  }
  return true;
}

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80             ? 1
                               : (lead & 0xe0) == 0xc0 ? 2
                               : (lead & 0xf0) == 0xe0 ? 3
                               : (lead & 0xf8) == 0xf0 ? 4
                                                       : 0;
    if (length == 0 || i + length > text.size()) return false;
    char32_t code = length == 1 ? lead : lead & (0x7fu >> length);
    for (std::size_t k = 1; k < length; ++k) {
      const auto tail = static_cast<unsigned char>(text[i + k]);
      if ((tail & 0xc0) != 0x80) return false;
      code = (code << 6) | (tail & 0x3f);
    }
    constexpr char32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
    if (code < kSmallest[length] || !is_code_point(code)) return false;
    i += length;
  }
  return true;
}

}  // namespace eventgan

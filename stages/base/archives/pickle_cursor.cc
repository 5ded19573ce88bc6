#include "stages/base/archives/detail/pickle_cursor.h"

#include <utf8.h>

#include <bit>
#include <charconv>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace eventgan {

PickleCursor::PickleCursor(std::span<const std::byte> bytes, std::string name)
    : bytes_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), name_(std::move(name)) {}

std::uint8_t PickleCursor::opcode() {
  opcode_at_ = position_;
  if (remaining() == 0) fail("STOP at the end of the pickle", "its end");
  return static_cast<std::uint8_t>(bytes_[position_++]);
}

std::string_view PickleCursor::take(std::uint64_t count) {
  if (count > remaining()) {
    fail(std::to_string(count) + " more bytes", std::to_string(remaining()));
  }
  const std::string_view taken = bytes_.substr(position_, count);
  position_ += count;
  return taken;
}

std::uint64_t PickleCursor::little_endian(int width) {
  const std::string_view bytes = take(static_cast<std::uint64_t>(width));
  std::uint64_t value = 0;
  for (int i = width - 1; i >= 0; --i) {
    value = value << 8 | static_cast<std::uint8_t>(bytes[static_cast<std::size_t>(i)]);
  }
  return value;
}

double PickleCursor::big_endian_double() {
  std::uint64_t bits = 0;
  for (const char byte : take(8)) bits = bits << 8 | static_cast<std::uint8_t>(byte);
  return std::bit_cast<double>(bits);
}

std::string_view PickleCursor::line() {
  const std::size_t end = bytes_.find('\n', position_);
  if (end == std::string_view::npos) fail("a line of text", "the end of the pickle");
  const std::string_view text = bytes_.substr(position_, end - position_);
  position_ = end + 1;
  return text;
}

void PickleCursor::fail(const std::string& expected, const std::string& got) const {
  throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name_ + " at byte " +
                           std::to_string(opcode_at_));
}

namespace {

template <class T, class... Format>
std::optional<T> parse_whole(std::string_view text, Format... format) {
  T value{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value, format...);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::optional<std::uint32_t> hex_at(std::string_view text, std::size_t at, std::size_t digits) {
  if (at > text.size() || text.size() - at < digits) return std::nullopt;
  return parse_whole<std::uint32_t>(text.substr(at, digits), 16);
}

// The byte that a backslash and `c` stand for; none if it is no simple escape.
std::optional<char> simple_escape(char c) {
  constexpr std::string_view kLetters = "abfnrtv\\'\"";
  constexpr std::string_view kMeanings = "\a\b\f\n\r\t\v\\'\"";
  const std::size_t at = kLetters.find(c);
  if (at == std::string_view::npos) return std::nullopt;
  return kMeanings[at];
}

}  // namespace

std::optional<std::int64_t> parse_pickle_integer(std::string_view text) {
  if (text.ends_with('L')) text.remove_suffix(1);
  return parse_whole<std::int64_t>(text);
}

std::optional<double> parse_pickle_float(std::string_view text) {
  return parse_whole<double>(text);
}

std::optional<std::string> parse_pickle_string(std::string_view text) {
  if (text.size() < 2 || (text.front() != '\'' && text.front() != '"') ||
      text.front() != text.back()) {
    return std::nullopt;
  }
  text = text.substr(1, text.size() - 2);
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\') {
      bytes += text[i];
      continue;
    }
    if (++i == text.size()) return std::nullopt;
    if (text[i] == 'x') {
      const auto value = hex_at(text, i + 1, 2);
      if (!value) return std::nullopt;
      bytes += static_cast<char>(*value);
      i += 2;
    } else if (const auto meaning = simple_escape(text[i])) {
      bytes += *meaning;
    } else {
      return std::nullopt;
    }
  }
  return bytes;
}

std::optional<std::string> parse_pickle_unicode(std::string_view text) try {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape =
        text[i] == '\\' && i + 1 < text.size() && (text[i + 1] == 'u' || text[i + 1] == 'U');
    if (!escape) {
      utf8::append(char32_t{static_cast<unsigned char>(text[i])}, result);
      continue;
    }
    const std::size_t digits = text[i + 1] == 'u' ? 4 : 8;
    const auto code = hex_at(text, i + 2, digits);
    if (!code) return std::nullopt;
    utf8::append(char32_t{*code}, result);
    i += 1 + digits;
  }
  return result;
} catch (const utf8::invalid_code_point&) {
  return std::nullopt;
}

}  // namespace eventgan

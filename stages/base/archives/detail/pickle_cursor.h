#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace eventgan {

/// Walks over the bytes of a pickle; nothing is read beyond their end. Every fault is a
/// std::runtime_error that names the file and the byte at which the opcode at hand starts.
class PickleCursor {
 public:
  PickleCursor(std::span<const std::byte> bytes, std::string name);

  /// The next opcode; messages point at it from now on.
  std::uint8_t opcode();

  /// The next `count` bytes.
  std::string_view take(std::uint64_t count);

  /// An unsigned integer of `width` bytes (1..8), little endian.
  std::uint64_t little_endian(int width);

  /// `width` bytes of length, then as many bytes.
  std::string_view counted(int width) { return take(little_endian(width)); }

  /// An IEEE 754 double, big endian.
  double big_endian_double();

  /// Up to the next line feed, which is skipped.
  std::string_view line();

  std::size_t position() const { return position_; }
  std::size_t remaining() const { return bytes_.size() - position_; }

  [[noreturn]] void fail(const std::string& expected, const std::string& got) const;

 private:
  std::string_view bytes_;
  std::string name_;
  std::size_t position_ = 0;
  std::size_t opcode_at_ = 0;
};

// The literals of protocol 0, which writes values as Python source text. None if malformed.

/// Decimal, 64 bits; one trailing "L" is allowed.
std::optional<std::int64_t> parse_pickle_integer(std::string_view text);

/// As Python's repr writes a float, "nan" and "inf" included.
std::optional<double> parse_pickle_float(std::string_view text);

/// A quoted string of Python 2 with its escapes; gives its bytes.
std::optional<std::string> parse_pickle_string(std::string_view text);

/// Python's raw-unicode-escape: Latin-1 with \uXXXX and \UXXXXXXXX; gives UTF-8.
std::optional<std::string> parse_pickle_unicode(std::string_view text);

}  // namespace eventgan

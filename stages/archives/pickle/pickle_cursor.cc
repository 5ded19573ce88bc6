#include <bit>
#include <stdexcept>
#include <utility>

#include "stages/archives/pickle/pickle_cursor_internal.h"

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

}  // namespace eventgan

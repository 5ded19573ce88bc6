#include "stages/base/files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>

namespace eventgan {

InputFile open_input(const std::filesystem::path& file, std::string& reason) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    reason = std::strerror(errno);
    return nullptr;
  }
  struct stat status {};
  const bool known = ::fstat(descriptor, &status) == 0;
  if (known && S_ISREG(status.st_mode)) {
    if (InputFile opened{::fdopen(descriptor, "rb")}) return opened;
  }
  reason = !known || S_ISREG(status.st_mode) ? std::strerror(errno)
           : S_ISDIR(status.st_mode)         ? std::strerror(EISDIR)
                                             : "Not a regular file";
  ::close(descriptor);
  return nullptr;
}

void require_regular_file(const std::filesystem::path& file) {
  std::string reason;
  if (!open_input(file, reason)) {
    throw std::runtime_error("expected a readable file, got '" + reason + "', in " + file.string());
  }
}

void load_ahead(const std::filesystem::path& file) {
  std::string nobody_asks;
  const InputFile opened = open_input(file, nobody_asks);
  struct stat status {};
  if (!opened || ::fstat(::fileno(opened.get()), &status) != 0) return;
  // At one call Linux loads no more than the file system's window for reading ahead: 128 KiB is the
  // smallest in use.
  constexpr off_t kWindow = 1 << 17;
  for (off_t at = 0; at < status.st_size; at += kWindow) {
    ::posix_fadvise(::fileno(opened.get()), at, kWindow, POSIX_FADV_WILLNEED);
  }
}

std::optional<std::string> try_read_file(const std::filesystem::path& file, std::string& reason) {
  const InputFile opened = open_input(file, reason);
  if (!opened) return std::nullopt;
  std::string bytes;
  std::array<char, 1 << 14> block;
  std::size_t count = 0;
  while ((count = std::fread(block.data(), 1, block.size(), opened.get())) > 0) {
    bytes.append(block.data(), count);
  }
  if (!std::ferror(opened.get())) return bytes;
  reason = std::strerror(errno);
  return std::nullopt;
}

std::string read_text_file(const std::filesystem::path& file) {
  std::string reason;
  if (auto bytes = try_read_file(file, reason)) return *std::move(bytes);
  throw std::runtime_error("cannot read " + file.string() + ": " + reason);
}

FileBytes::FileBytes(const std::filesystem::path& file) : path_(file.string()) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error) {
    throw std::runtime_error("expected a file, got \"" + error.message() + "\", in " + path_);
  }
  size_bytes_ = size;
  stream_.open(file, std::ios::binary);
}

std::vector<std::byte> FileBytes::read(std::uint64_t offset, std::uint64_t count) const {
  if (offset > size_bytes_ || count > size_bytes_ - offset) {
    throw std::runtime_error("expected " + std::to_string(count) + " bytes from byte " +
                             std::to_string(offset) + " on, got a file of " +
                             std::to_string(size_bytes_) + " bytes, in " + path_);
  }
  std::vector<std::byte> bytes(count);
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(offset));
  stream_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count));
  if (!stream_.is_open() || !stream_) {
    throw std::runtime_error("expected " + std::to_string(count) + " readable bytes from byte " +
                             std::to_string(offset) + " on, got fewer, in " + path_);
  }
  return bytes;
}

}  // namespace eventgan

#include "stages/archives/file_bytes.h"

#include <stdexcept>
#include <system_error>

namespace eventgan {

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

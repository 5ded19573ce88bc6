#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace eventgan {

/// A file of which parts are read. Throws std::runtime_error naming the file if it is not there, no
/// regular file, or shorter than it was. Not thread safe.
class FileBytes {
 public:
  explicit FileBytes(const std::filesystem::path& file);

  std::uint64_t size_bytes() const { return size_bytes_; }

  /// `count` bytes from `offset` on; nothing is allocated unless the file is that long.
  std::vector<std::byte> read(std::uint64_t offset, std::uint64_t count) const;

 private:
  std::string path_;
  mutable std::ifstream stream_;
  std::uint64_t size_bytes_ = 0;
};

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace eventgan {

/// A file of which parts are read, too large to be held whole. Thread safe.
///
/// Why not mapped into memory: a read error or a file that shrinks would end the process.
class RandomAccessFile {
 public:
  /// Throws InputError if it is no readable file.
  explicit RandomAccessFile(const std::filesystem::path& path);
  ~RandomAccessFile();
  RandomAccessFile(const RandomAccessFile&) = delete;
  RandomAccessFile& operator=(const RandomAccessFile&) = delete;

  const std::string& name() const { return name_; }
  std::int64_t size_bytes() const { return size_bytes_; }

  /// The bytes begin..end, which must lie in the file. Throws InputError if they cannot be read.
  std::string read(std::int64_t begin, std::int64_t end) const;

 private:
  std::string name_;
  int descriptor_;
  std::int64_t size_bytes_ = 0;
};

}  // namespace eventgan

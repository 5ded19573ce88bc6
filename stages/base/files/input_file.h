#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace eventgan {

// Every input is opened through these, or checked by require_regular_file before a library opens it
// by name: only regular files and links to them are read, and opening never waits. A FIFO would
// wait for its writer, for ever perhaps, and a device need not end.

struct CloseInput {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
/// One of C's streams, since they tell why reading fails.
using InputFile = std::unique_ptr<std::FILE, CloseInput>;

/// The file, open at its start; null if it cannot be opened or is no regular file, and then
/// `reason` says why ("Permission denied", "Not a regular file"). Thread safe.
InputFile open_input(const std::filesystem::path& file, std::string& reason);

/// Throws std::runtime_error naming the path unless open_input would open it. Thread safe.
void require_regular_file(const std::filesystem::path& file);

/// Asks the system to load the file into its cache, and does not wait for it; does nothing if the
/// file cannot be opened: who reads it will say why. Thread safe.
void load_ahead(const std::filesystem::path& file);

/// The whole file as it is; none if it cannot be read, and then `reason` says why. Thread safe.
std::optional<std::string> try_read_file(const std::filesystem::path& file, std::string& reason);

/// The same. Throws std::runtime_error naming the path if there is none, it is no
/// regular file, or it cannot be read. Thread safe.
std::string read_text_file(const std::filesystem::path& file);

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

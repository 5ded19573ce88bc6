#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace eventgan {

/// A file that is read: the way in of every input. Only regular files and links to them are opened,
/// as the open descriptor tells, and opening never waits: a FIFO would wait for its writer, for
/// ever perhaps, and a device need not end. (Only what a library opens by its name, as HDF5 and
/// FFmpeg do, is opened once more; require_regular_file is asked before.)
///
/// Errors are InputError "expected a readable file, got 'REASON', in NAME", or of a file that is
/// shorter than what is asked for, or than it was, "expected 7 bytes from byte 0 on, got a file of
/// 6 bytes, in NAME"; and LimitReached, naming the file, if the process has too many files open or
/// no memory for what is asked for. Thread safe.
///
/// Why it is not mapped into memory: a read error or a file that shrinks would end the process.
class InputFile {
 public:
  /// `name`: what messages call it; empty: the path.
  explicit InputFile(const std::filesystem::path& file, std::string name = "");

  /// None if it cannot be opened or is no regular file, and then `reason` says why ("Permission
  /// denied", "Not a regular file").
  static std::optional<InputFile> open(const std::filesystem::path& file, std::string& reason);

  ~InputFile();
  InputFile(InputFile&& other) noexcept
      : path_(std::move(other.path_)),
        name_(std::move(other.name_)),
        descriptor_(std::exchange(other.descriptor_, -1)),
        size_bytes_(other.size_bytes_) {}
  InputFile& operator=(InputFile&&) = delete;

  const std::string& name() const { return name_; }
  /// When it was opened.
  std::uint64_t size_bytes() const { return size_bytes_; }
  /// For libraries that take one; stays this object's.
  int descriptor() const { return descriptor_; }

  /// `count` bytes from `offset` on; nothing is allocated unless the file was that long.
  std::string read(std::uint64_t offset, std::uint64_t count) const;
  std::vector<std::byte> read_bytes(std::uint64_t offset, std::uint64_t count) const;
  /// The same for those who count places with a sign: from `begin` up to `end`, at most end_byte().
  std::string read_between(std::int64_t begin, std::int64_t end) const {
    return read(static_cast<std::uint64_t>(begin), static_cast<std::uint64_t>(end - begin));
  }
  std::int64_t end_byte() const { return static_cast<std::int64_t>(size_bytes_); }
  /// Reads until `to` is full or the file ends; gives how many bytes.
  std::size_t read_some(std::uint64_t offset, std::span<char> to) const;
  /// All of it, up to where it ends now.
  std::string read_all() const;

  struct CloseStream {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  using Stream = std::unique_ptr<std::FILE, CloseStream>;
  /// From its start, for libraries that take a stream of C. It reads blocks of so many bytes, of
  /// which the latest is kept: moving within it reads nothing. It has no descriptor, may not
  /// outlive this object, and is one thread's.
  Stream stream(std::size_t block_bytes) const;

  /// Asks the system to load it all into its cache, and does not wait for that.
  void load_ahead() const;

 private:
  InputFile(std::filesystem::path path, int descriptor, std::uint64_t size_bytes)
      : path_(std::move(path)),
        name_(path_.string()),
        descriptor_(descriptor),
        size_bytes_(size_bytes) {}
  /// As read_some and read_all, but where reading fails these leave errno and give none.
  std::optional<std::size_t> try_read(std::uint64_t offset, std::span<char> to) const;
  std::optional<std::string> try_read_all() const;
  void read_exactly(std::uint64_t offset, std::span<char> to) const;
  void require(std::uint64_t offset, std::uint64_t count) const;
  [[noreturn]] void fail() const;  // of errno
  friend std::optional<std::string> try_read_file(const std::filesystem::path&, std::string&);

  std::filesystem::path path_;
  std::string name_;
  int descriptor_;
  std::uint64_t size_bytes_;
};

/// The whole file as it is; none if it cannot be read, and then `reason` says why. Thread safe.
std::optional<std::string> try_read_file(const std::filesystem::path& file, std::string& reason);

/// The same. Throws std::runtime_error "cannot read PATH: REASON", no InputError, since the
/// program's own files are read by it, too. Thread safe.
std::string read_text_file(const std::filesystem::path& file);

/// Throws InputError unless it can be opened as an InputFile. Thread safe.
void require_regular_file(const std::filesystem::path& file);

/// Throws LimitReached naming the file if `error`, an errno, says that no more files may be open.
void require_open_files_left(int error, const std::string& name);

/// How many files may be kept open for later: a quarter of those that the process may have open, at
/// least 8, and no more than `most`. Thread safe.
std::size_t files_to_keep_open(std::size_t most);

/// Counts, while it lives, how often each file is opened as an InputFile, and how many bytes are
/// read of it. For tests; without one nothing is counted. One at a time, made and destroyed while
/// no other thread reads.
class InputCounter {
 public:
  struct Count {
    std::uint64_t opens = 0;
    std::uint64_t bytes = 0;
  };

  InputCounter();
  ~InputCounter();
  InputCounter(const InputCounter&) = delete;
  InputCounter& operator=(const InputCounter&) = delete;

  /// Of a file by any path that differs only in "." and "..". Thread safe.
  Count of(const std::filesystem::path& file) const;

 private:
  friend class InputFile;
  /// Adds to what is counted now, if anything is.
  static void add(const std::filesystem::path& file, Count more);

  static std::atomic<InputCounter*> current_;
  mutable std::mutex mutex_;
  std::map<std::filesystem::path, Count> counts_;
};

}  // namespace eventgan

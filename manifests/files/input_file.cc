#include "manifests/files/input_file.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <stdexcept>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

[[noreturn]] void refuse(const std::string& reason, const std::string& name) {
  throw InputError("expected a readable file, got '" + reason + "', in " + name);
}

std::span<char> characters(std::vector<std::byte>& bytes) {
  return {reinterpret_cast<char*>(bytes.data()), bytes.size()};
}

template <class Bytes>
Bytes zeros(std::size_t count, const std::string& name) try {
  return Bytes(count, typename Bytes::value_type{});
} catch (const std::bad_alloc&) {
  throw LimitReached("cannot read " + name + ": no memory for " + std::to_string(count) + " bytes");
}

}  // namespace

std::optional<InputFile> InputFile::open(const std::filesystem::path& file, std::string& reason) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    const int error = errno;
    require_open_files_left(error, file.string());
    reason = std::strerror(error);
    return std::nullopt;
  }
  struct stat status {};
  const int error = ::fstat(descriptor, &status) == 0 ? 0 : errno;
  if (error == 0 && S_ISREG(status.st_mode)) {
    InputCounter::add(file, {.opens = 1, .bytes = 0});
    return InputFile(file, descriptor, static_cast<std::uint64_t>(status.st_size));
  }
  ::close(descriptor);
  const bool is_folder = error == 0 && S_ISDIR(status.st_mode);
  reason = error != 0  ? std::strerror(error)
           : is_folder ? std::strerror(EISDIR)
                       : "Not a regular file";
  return std::nullopt;
}

InputFile::InputFile(const std::filesystem::path& file, std::string name)
    : InputFile([&] {
        std::string reason;
        if (auto opened = open(file, reason)) return *std::move(opened);
        refuse(reason, name.empty() ? file.string() : name);
      }()) {
  if (!name.empty()) name_ = std::move(name);
}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void InputFile::fail() const { refuse(std::strerror(errno), name_); }

std::optional<std::size_t> InputFile::try_read(std::uint64_t offset, std::span<char> to) const {
  std::size_t have = 0;
  while (have < to.size()) {
    const ssize_t got =
        ::pread(descriptor_, to.data() + have, to.size() - have, static_cast<off_t>(offset + have));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return std::nullopt;
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  InputCounter::add(path_, {.opens = 0, .bytes = have});
  return have;
}

std::size_t InputFile::read_some(std::uint64_t offset, std::span<char> to) const {
  const auto got = try_read(offset, to);
  if (!got) fail();
  return *got;
}

void InputFile::require(std::uint64_t offset, std::uint64_t count) const {
  if (offset <= size_bytes_ && count <= size_bytes_ - offset) return;
  throw InputError("expected " + std::to_string(count) + " bytes from byte " +
                   std::to_string(offset) + " on, got a file of " + std::to_string(size_bytes_) +
                   " bytes, in " + name_);
}

void InputFile::read_exactly(std::uint64_t offset, std::span<char> to) const {
  const std::size_t got = read_some(offset, to);
  if (got == to.size()) return;
  throw InputError("expected " + std::to_string(to.size()) + " bytes from byte " +
                   std::to_string(offset) + " on, got a file that has shrunk to " +
                   std::to_string(offset + got) + " bytes, in " + name_);
}

std::string InputFile::read(std::uint64_t offset, std::uint64_t count) const {
  require(offset, count);
  auto bytes = zeros<std::string>(count, name_);
  read_exactly(offset, bytes);
  return bytes;
}

std::vector<std::byte> InputFile::read_bytes(std::uint64_t offset, std::uint64_t count) const {
  require(offset, count);
  auto bytes = zeros<std::vector<std::byte>>(count, name_);
  read_exactly(offset, characters(bytes));
  return bytes;
}

std::optional<std::string> InputFile::try_read_all() const {
  // One more tells the end.
  auto bytes = zeros<std::string>(std::max<std::size_t>(size_bytes_ + 1, 4096), name_);
  std::size_t have = 0;
  for (;;) {
    const auto got = try_read(have, std::span(bytes).subspan(have));
    if (!got) return std::nullopt;
    have += *got;
    if (have < bytes.size()) break;
    bytes.resize(2 * bytes.size());  // it has grown, or tells no size, as those of /proc
  }
  bytes.resize(have);
  return bytes;
}

std::string InputFile::read_all() const {
  if (auto bytes = try_read_all()) return *std::move(bytes);
  fail();
}

namespace {

/// Where a stream of C is in its file.
struct StreamPlace {
  const InputFile& file;
  std::vector<char> block;
  std::uint64_t block_begin = 0;
  std::size_t block_size = 0;  ///< of `block` what is read
  std::uint64_t offset = 0;
};

ssize_t read_stream(void* cookie, char* to, std::size_t count) {
  auto& [file, block, begin, size, offset] = *static_cast<StreamPlace*>(cookie);
  if (offset < begin || offset >= begin + size) {
    try {
      size = file.read_some(offset, block);
    } catch (const InputError&) {  // the library sees ferror()
      return -1;
    }
    begin = offset;
  }
  const std::size_t within = offset - begin;
  const std::size_t given = std::min(count, size - within);
  std::copy_n(block.data() + within, given, to);
  offset += given;
  return static_cast<ssize_t>(given);
}

int seek_stream(void* cookie, off64_t* to, int from) {
  auto& [file, block, begin, size, offset] = *static_cast<StreamPlace*>(cookie);
  if (from == SEEK_CUR) *to += static_cast<off64_t>(offset);
  if (from == SEEK_END) *to += static_cast<off64_t>(file.size_bytes());
  if (*to < 0) return -1;
  offset = static_cast<std::uint64_t>(*to);
  return 0;
}

int close_stream(void* cookie) {
  delete static_cast<StreamPlace*>(cookie);
  return 0;
}

}  // namespace

InputFile::Stream InputFile::stream(std::size_t block_bytes) const {
  const auto enough = std::min<std::uint64_t>(block_bytes, size_bytes_ + 1);
  auto place = std::make_unique<StreamPlace>(StreamPlace{*this, std::vector<char>(enough)});
  Stream stream(
      ::fopencookie(place.get(), "rb", {read_stream, nullptr, seek_stream, close_stream}));
  if (!stream) throw std::bad_alloc();
  static_cast<void>(place.release());  // close_stream has it
  return stream;
}

void InputFile::load_ahead() const {
  // At one call Linux loads no more than the file system's window for reading ahead: 128 KiB is the
  // smallest in use.
  constexpr off_t kWindow = 1 << 17;
  for (off_t at = 0; at < static_cast<off_t>(size_bytes_); at += kWindow) {
    ::posix_fadvise(descriptor_, at, kWindow, POSIX_FADV_WILLNEED);
  }
}

std::optional<std::string> try_read_file(const std::filesystem::path& file, std::string& reason) {
  const auto opened = InputFile::open(file, reason);
  if (!opened) return std::nullopt;
  auto bytes = opened->try_read_all();
  if (!bytes) reason = std::strerror(errno);
  return bytes;
}

std::string read_text_file(const std::filesystem::path& file) {
  std::string reason;
  if (auto bytes = try_read_file(file, reason)) return *std::move(bytes);
  throw std::runtime_error("cannot read " + file.string() + ": " + reason);
}

void require_open_files_left(int error, const std::string& name) {
  if (error != EMFILE && error != ENFILE) return;
  throw LimitReached("cannot open " + name + ": " + std::strerror(error) +
                     " (ulimit -n sets how many the process may have)");
}

std::size_t files_to_keep_open(std::size_t most) {
  constexpr rlim_t kFewest = 8;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return kFewest;
  return std::min<rlim_t>(most, std::max(kFewest, limit.rlim_cur / 4));
}

void require_regular_file(const std::filesystem::path& file) { InputFile{file}; }

std::atomic<InputCounter*> InputCounter::current_ = nullptr;

InputCounter::InputCounter() { current_ = this; }

InputCounter::~InputCounter() { current_ = nullptr; }

InputCounter::Count InputCounter::of(const std::filesystem::path& file) const {
  const std::lock_guard lock(mutex_);
  const auto found = counts_.find(std::filesystem::absolute(file).lexically_normal());
  return found == counts_.end() ? Count() : found->second;
}

void InputCounter::add(const std::filesystem::path& file, Count more) {
  InputCounter* const counter = current_.load(std::memory_order_relaxed);
  if (counter == nullptr) return;
  const std::lock_guard lock(counter->mutex_);
  Count& count = counter->counts_[std::filesystem::absolute(file).lexically_normal()];
  count.opens += more.opens;
  count.bytes += more.bytes;
}

}  // namespace eventgan

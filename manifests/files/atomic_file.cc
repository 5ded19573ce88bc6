#include "manifests/files/atomic_file.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "manifests/files/unfinished_files.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Bytes that a file of this process may have; none: any number.
std::optional<rlim_t> size_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return {};
  return limit.rlim_cur;
}

std::string limit_text(rlim_t limit) {
  return " (ulimit -f allows files of " + std::to_string(limit) + " bytes)";
}

[[noreturn]] void fail(const std::string& what) { throw_system_error(what, errno); }

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// link() and not rename(), because it fails where the target exists. Over NFS its answer can be
/// lost after it worked; the count of links tells.
bool link_exclusively(const fs::path& temporary, const fs::path& target) {
  if (::link(temporary.c_str(), target.c_str()) == 0) return true;
  const int error = errno;
  struct stat status {};
  if (::stat(temporary.c_str(), &status) == 0 && status.st_nlink == 2) return true;
  if (error == EEXIST) return false;
  // File systems without links.
  if (::renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) == 0) {
    return true;
  }
  if (errno == EEXIST) return false;
  fail("cannot link " + temporary.string() + " as " + target.string());
}

}  // namespace

void throw_system_error(const std::string& what, int error) {
  const auto limit = error == EFBIG ? size_limit() : std::nullopt;
  throw std::system_error(error, std::generic_category(), limit ? what + limit_text(*limit) : what);
}

std::string unsaid_reason(const fs::path& file) {
  const auto limit = size_limit();
  std::error_code unknown;
  const auto size = fs::file_size(file, unknown);
  return limit && !unknown && size >= *limit ? limit_text(*limit) : " (is the disk full?)";
}

fs::path temporary_beside(const fs::path& target) {
  static std::atomic<unsigned> next_attempt{0};
  fs::path temporary;
  do {  // a dead process with this one's pid, in a container that was started again, can have left
        // its file
    temporary = folder_of(target) / to_string(TemporaryName{target.filename().string(), host_name(),
                                                            ::getpid(), next_attempt++});
  } while (fs::exists(fs::symlink_status(temporary)));
  return temporary;
}

void require_no_link(const fs::path& folder, const fs::path& relative) {
  fs::path path = folder;
  for (const fs::path& part : relative) {
    path /= part;
    if (!fs::is_symlink(fs::symlink_status(path))) continue;
    throw std::runtime_error("expected no link out of " + folder.string() +
                             ", got a symbolic link, in " + path.string());
  }
}

void sync_to_disk(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail("cannot open " + path.string());
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  // Some network file systems have no fsync for folders; they make renames durable by themselves.
  if (error == 0 || (error == EINVAL && fs::is_directory(path))) return;
  errno = error;
  fail("cannot flush " + path.string() + " to disk");
}

void publish(const fs::path& temporary, const fs::path& target) {
  if (::rename(temporary.c_str(), target.c_str()) != 0) {
    fail("cannot rename " + temporary.string() + " to " + target.string());
  }
  sync_to_disk(folder_of(target));
}

AtomicFile::AtomicFile(fs::path target)
    : target_(std::move(target)), temporary_(temporary_beside(target_)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  ::unlink(temporary_.c_str());  // of a link to it, or what is left after an error
}

void AtomicFile::create() {
  descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail("cannot create " + temporary_.string());
}

void AtomicFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("cannot write " + temporary_.string());
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void AtomicFile::overwrite(std::int64_t byte, std::string_view bytes) {
  if (::lseek(descriptor_, byte, SEEK_SET) < 0) fail("cannot write " + temporary_.string());
  write(bytes);
  if (::lseek(descriptor_, 0, SEEK_END) < 0) fail("cannot write " + temporary_.string());
}

void AtomicFile::sync() {
  if (descriptor_ < 0) {
    sync_to_disk(temporary_);
    // Network file systems report some errors of writing only when a file is closed.
  } else if (::fsync(descriptor_) != 0 || ::close(std::exchange(descriptor_, -1)) != 0) {
    fail("cannot write " + temporary_.string());
  }
  synced_ = true;
}

void AtomicFile::publish() {
  if (!synced_) sync();
  eventgan::publish(temporary_, target_);
}

bool AtomicFile::publish_if_absent() {
  if (!synced_) sync();
  if (!link_exclusively(temporary_, target_)) return false;
  sync_to_disk(folder_of(target_));
  return true;
}

void write_file_atomically(const fs::path& target, std::string_view text) {
  AtomicFile file(target);
  file.create();
  file.write(text);
  file.publish();
}

bool create_file_atomically(const fs::path& target,
                            const std::function<void(const TextSink&)>& write) {
  if (fs::exists(fs::symlink_status(target))) return false;
  AtomicFile file(target);
  file.create();
  write([&](std::string_view text) { file.write(text); });
  return file.publish_if_absent();
}

}  // namespace eventgan

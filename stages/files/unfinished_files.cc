#include "stages/files/unfinished_files.h"

#include <signal.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

namespace eventgan {
namespace {

namespace fs = std::filesystem;

timespec now(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return time;
}

double seconds_between(const timespec& first, const timespec& last) {
  return double(last.tv_sec - first.tv_sec) + 1e-9 * double(last.tv_nsec - first.tv_nsec);
}

/// When this process began, by the clock that the kernel stamps files with: it ticks so coarsely
/// that a file written now can bear a time before the precise clock's now.
const timespec kProcessStart = now(CLOCK_REALTIME_COARSE);

WriterLife life_of(const TemporaryName& name, const timespec& last_write) {
  if (name.host != host_name()) return WriterLife::kUnknown;
  const bool own = name.pid == ::getpid();
  if (own && seconds_between(last_write, kProcessStart) > 0) return WriterLife::kDead;
  // A process of another user answers EPERM: it is alive.
  const bool gone = ::kill(name.pid, 0) != 0 && errno == ESRCH;
  return gone ? WriterLife::kDead : WriterLife::kAlive;
}

/// None if it is no temporary, or is one no more: its writer or another cleaner was faster.
std::optional<UnfinishedFile> look_at(const fs::path& path) {
  const auto name = parse_temporary_name(path.filename().string());
  struct stat status {};
  if (!name || ::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  const double silent_s = seconds_between(status.st_mtim, now(CLOCK_REALTIME));
  return UnfinishedFile{path, *name, life_of(*name, status.st_mtim), std::max(silent_s, 0.0)};
}

}  // namespace

const char* to_string(WriterLife life) {
  if (life == WriterLife::kUnknown) return "unknown";
  return life == WriterLife::kAlive ? "alive" : "dead";
}

std::vector<UnfinishedFile> unfinished_files(const fs::path& folder) {
  std::vector<UnfinishedFile> files;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (auto file = look_at(entry->path())) files.push_back(*std::move(file));
  }
  if (error) throw std::runtime_error("cannot list " + folder.string() + ": " + error.message());
  std::sort(files.begin(), files.end(),
            [](const auto& one, const auto& other) { return one.path < other.path; });
  return files;
}

bool is_stale(const UnfinishedFile& file) {
  return file.writer == WriterLife::kDead || file.silent_s >= kSilenceOfTheDead_s;
}

}  // namespace eventgan

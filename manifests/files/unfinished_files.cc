#include "manifests/files/unfinished_files.h"

#include <limits.h>
#include <signal.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnding = ".tmp";

/// Cuts ".NUMBER" off the end of `text`; false if there is none.
template <class Number>
bool take_number(std::string_view& text, Number& number) {
  const std::size_t dot = text.rfind('.');
  if (dot == std::string_view::npos) return false;
  const std::string_view digits = text.substr(dot + 1);
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), number);
  if (error != std::errc() || end != digits.end()) return false;
  text = text.substr(0, dot);
  return true;
}

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

/// Of a process that has ended, whose parent has not asked how: a container's first process often
/// never does. False if /proc is that of other processes.
bool is_zombie(pid_t pid) {
  std::error_code error;
  if (fs::read_symlink("/proc/self", error) != std::to_string(::getpid())) return false;
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");  // "PID (NAME) STATE ..."
  std::string line;
  std::getline(file, line);
  const std::size_t name_end = line.rfind(')');
  return name_end != std::string::npos && line.substr(name_end).starts_with(") Z");
}

WriterLife life_of(const TemporaryName& name, const timespec& last_write) {
  if (name.host != host_name()) return WriterLife::kUnknown;
  const bool own = name.pid == ::getpid();
  if (own && seconds_between(last_write, kProcessStart) > 0) return WriterLife::kDead;
  // A process of another user answers EPERM: it is alive.
  const bool gone = ::kill(name.pid, 0) != 0 && errno == ESRCH;
  return gone || is_zombie(name.pid) ? WriterLife::kDead : WriterLife::kAlive;
}

/// None if it is no temporary, or is one no more: its writer or another cleaner was faster.
std::optional<UnfinishedFile> look_at(const fs::path& path) {
  const auto name = parse_temporary_name(path.filename().string());
  struct stat status {};
  if (!name || ::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  const double silent_s = seconds_between(status.st_mtim, now(CLOCK_REALTIME));
  return UnfinishedFile{path, *name, life_of(*name, status.st_mtim), silent_s};
}

}  // namespace

std::string to_string(const TemporaryName& name) {
  return "." + name.target + "." + name.host + "." + std::to_string(name.pid) + "." +
         std::to_string(name.attempt) + std::string(kEnding);
}

std::optional<TemporaryName> parse_temporary_name(std::string_view name) {
  if (!name.starts_with('.') || !name.ends_with(kEnding)) return std::nullopt;
  name = name.substr(1, name.size() - 1 - kEnding.size());
  TemporaryName parsed;
  if (!take_number(name, parsed.attempt) || !take_number(name, parsed.pid)) return std::nullopt;
  // Unlike the target, the host has no dots.
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos) return std::nullopt;
  parsed.target = name.substr(0, dot);
  parsed.host = name.substr(dot + 1);
  const bool whole = parsed.pid > 0 && !parsed.target.empty() && !parsed.host.empty();
  return whole ? std::optional(parsed) : std::nullopt;
}

std::string without_dots(std::string machine) {
  std::replace_if(
      machine.begin(), machine.end(), [](char c) { return c == '.' || c == '/'; }, '_');
  return machine;
}

std::string host_name() {
  std::array<char, HOST_NAME_MAX + 1> name{};
  const bool named = ::gethostname(name.data(), name.size() - 1) == 0 && name[0] != '\0';
  std::string host = without_dots(named ? name.data() : "localhost");
  struct stat space {};
  if (::stat("/proc/self/ns/pid", &space) == 0) host += "-" + std::to_string(space.st_ino);
  return host;
}

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
  return file.writer == WriterLife::kDead || std::abs(file.silent_s) >= kSilenceOfTheDead_s;
}

std::vector<fs::path> remove_stale_temporaries(const fs::path& folder, std::string_view target) {
  std::vector<fs::path> removed;
  for (const UnfinishedFile& file : unfinished_files(folder)) {
    if (!is_stale(file) || (!target.empty() && file.name.target != target)) continue;
    // Another process may be cleaning as well; what is gone already does not count.
    std::error_code error;
    if (fs::remove(file.path, error)) removed.push_back(file.path);
  }
  return removed;
}

}  // namespace eventgan

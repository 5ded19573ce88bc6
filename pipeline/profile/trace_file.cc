#include "pipeline/profile/trace_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "manifests/faults.h"
#include "stages/files/atomic_file.h"
#include "stages/files/unfinished_files.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& expected, const std::string& got,
                         const fs::path& file) {
  throw UsageError("--profile: expected " + expected + ", got " + got + ", in " + file.string());
}

bool is_empty_or_trace(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return false;  // a file that may not be read is not ours to replace
  std::string start(kTraceBegins.size(), '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  return stream.gcount() == 0 || start == kTraceBegins;
}

void check_target(const fs::path& target) {
  if (target.filename().empty()) refuse("a file", "a folder or nothing", target);
  std::error_code error;
  const fs::file_status status = fs::status(target, error);
  if (!fs::exists(status)) return;
  if (!fs::is_regular_file(status)) refuse("a file", "something else", target);
  if (!is_empty_or_trace(target)) refuse("a new file or an earlier trace", "another file", target);
}

void remove_leftovers(const fs::path& target) {
  try {
    const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
    for (const UnfinishedFile& file : unfinished_files(folder)) {
      if (file.name.target == target.filename() && is_stale(file)) fs::remove(file.path);
    }
  } catch (const std::runtime_error&) {
    // Whether a trace can be written is what counts; that is tried next.
  }
}

}  // namespace

TraceFile::TraceFile(fs::path target) : target_(std::move(target)) {
  check_target(target_);
  std::error_code error;  // of a file that is not there yet
  const fs::path behind_links = fs::canonical(target_, error);
  if (!error) target_ = behind_links;
  remove_leftovers(target_);
  temporary_ = temporary_beside(target_);
  descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) refuse("a file that can be written", std::strerror(errno), target_);
}

TraceFile::~TraceFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_.c_str());
}

void TraceFile::write(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor_, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      throw std::runtime_error("cannot write " + target_.string() + ": " + std::strerror(errno));
    }
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

void TraceFile::commit() {
  sync_to_disk(temporary_);
  publish(temporary_, target_);
  ::close(std::exchange(descriptor_, -1));
}

}  // namespace eventgan

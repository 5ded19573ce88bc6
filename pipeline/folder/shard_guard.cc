#include "pipeline/folder/shard_guard.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iostream>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/memory.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Of the processor, for one step: the columns of a shard, or one sample.
constexpr int kLimit_s = 10;

/// Signals of what HDF5 may do with a damaged file; any other comes from outside.
constexpr std::array kCrashes{SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL};

bool is_limited = false;  // this process is a child

[[noreturn]] void fail(const fs::path& shard, const std::string& got) {
  throw std::runtime_error("expected a whole shard, got a damaged one (" + got + "), in " +
                           shard.string());
}

/// The commit record beside the shard; none if there is no such file, or it is not this shard's.
std::optional<CommitRecord> commit_record_beside(const fs::path& shard) {
  try {
    const std::string name = shard.filename().string();
    const fs::path file = shard.parent_path() / commit_record_name(name);
    CommitRecord record = parse_commit_record(read_text_file(file), file.string());
    if (record.shard == name) return record;
  } catch (const std::logic_error&) {  // not the name of a shard
  } catch (const std::runtime_error&) {
  }
  return std::nullopt;
}

void require_bytes_of(const CommitRecord& record, const fs::path& shard) {
  const auto size_bytes = static_cast<std::int64_t>(fs::file_size(shard));
  if (size_bytes != record.size_bytes) {
    fail(shard, "size in bytes in its commit record " + std::to_string(record.size_bytes) +
                    ", of the file " + std::to_string(size_bytes));
  }
  if (const std::string hash = sha256_of_file(shard); hash != record.sha256) {
    fail(shard, "SHA-256 in its commit record " + record.sha256 + ", of the file " + hash);
  }
}

/// A damaged size may ask for any amount; what the system grants and cannot give it takes from
/// other processes.
void limit_memory() {
  std::ifstream statm("/proc/self/statm");
  rlim_t pages = 0;
  if (!(statm >> pages)) return;
  const rlim_t now = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
  const rlim_t most = now + memory_limit_bytes() / 2;
  const rlimit limit{most, most};
  ::setrlimit(RLIMIT_AS, &limit);
}

void tell_of_memory(const fs::path& shard) {
  std::cerr << "error: expected a whole shard, got a damaged one (it asks for more memory than is "
               "available), in "
            << escape_controls(shard.string()) << std::endl;
}

/// 0: none.
void set_time_limit(int seconds) {
  if (!is_limited) return;
  const itimerval limit{{0, 0}, {seconds, 0}};
  ::setitimer(ITIMER_PROF, &limit, nullptr);  // its signal ends the process
}

/// The child's whole life, with its errors going to `errors`.
[[noreturn]] void live(const fs::path& shard, const std::function<int()>& read, int errors) {
  ::dup2(errors, STDERR_FILENO);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Whoever handles crashes (a sanitizer, a library) would turn them into ends of another kind.
  for (const int crash : kCrashes) std::signal(crash, SIG_DFL);
  is_limited = true;
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  limit_memory();
  renew_time_limit();
  int code = kFailed;
  try {
    code = read();
    // The parent cannot see what the child has failed to print.
    if (!std::cout.flush()) throw std::runtime_error("cannot write to standard output");
  } catch (const std::bad_alloc&) {
    tell_of_memory(shard);
  } catch (const std::length_error&) {
    tell_of_memory(shard);
  } catch (const std::exception& error) {
    std::cerr << "error: " << escape_controls(error_line(error)) << std::endl;
    code = exit_code_of(error);
  }
  ::_exit(code);  // what the parent has to do at its end is the parent's
}

/// Until the child has closed its end.
std::string read_to_end(int descriptor) {
  std::string text;
  std::array<char, 4096> block{};
  for (;;) {
    const ssize_t size = ::read(descriptor, block.data(), block.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return text;
    text.append(block.data(), static_cast<std::size_t>(size));
  }
}

int in_child(const fs::path& shard, const std::function<int()>& read) {
  const auto fail_to = [&](const char* action, int error) {
    throw std::runtime_error(std::string("cannot ") + action + " a process to read " +
                             shard.string() + ": " + std::strerror(error));
  };
  int errors[2];
  std::cout.flush();
  if (::pipe(errors) != 0) fail_to("start", errno);
  const pid_t child = ::fork();
  const int fork_error = errno;
  if (child == 0) {
    ::close(errors[0]);
    live(shard, read, errors[1]);
  }
  ::close(errors[1]);
  const std::string said = read_to_end(errors[0]);
  ::close(errors[0]);
  if (child < 0) fail_to("start", fork_error);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) fail_to("wait for", errno);
  }
  if (WIFEXITED(status)) {
    std::cerr << said << std::flush;
    return WEXITSTATUS(status);
  }
  // What a library says that dies of it (glibc, of its heap) would only be in the way.
  const int signal = WTERMSIG(status);
  if (signal == SIGPROF) {
    fail(shard, "HDF5 did not finish within " + std::to_string(kLimit_s) + " s");
  }
  const std::string name = ::strsignal(signal);
  if (std::ranges::find(kCrashes, signal) != kCrashes.end()) fail(shard, "HDF5 ended with " + name);
  throw std::runtime_error("reading " + shard.string() + " was stopped by a signal from outside (" +
                           name + ")");
}

}  // namespace

int read_guarded(const fs::path& shard, const std::function<int()>& read) {
  std::error_code unknown;
  const fs::file_status status = fs::status(shard, unknown);
  if (!fs::exists(status)) return read();  // which says so
  if (!fs::is_regular_file(status)) {
    throw std::runtime_error("expected a shard, got no regular file, in " + shard.string());
  }
  if (const auto record = commit_record_beside(shard)) {
    require_bytes_of(*record, shard);
    return read();
  }
  return in_child(shard, read);
}

int read_apart(const fs::path& where, const std::function<int()>& read) {
  return in_child(where, read);
}

void renew_time_limit() { set_time_limit(kLimit_s); }

void lift_time_limit() { set_time_limit(0); }

}  // namespace eventgan

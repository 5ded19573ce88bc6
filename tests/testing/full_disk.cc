#include "tests/testing/full_disk.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

namespace {
bool is_child = false;
}

/// Asked by LeakSanitizer at the end of a process. A forked child has none of its parent's threads:
/// what these hold, such as HDF5's record of each thread, looks lost there.
extern "C" int __lsan_is_turned_off() { return is_child ? 1 : 0; }

namespace eventgan::testing {
namespace {

[[noreturn]] void run_child(std::size_t limit_bytes, const std::function<void()>& work, int out) {
  is_child = true;
  ::signal(SIGXFSZ, SIG_IGN);  // else the signal ends the process before write() can fail
  const rlimit limit{limit_bytes, limit_bytes};
  ::setrlimit(RLIMIT_FSIZE, &limit);
  std::string message = "no error";
  try {
    work();
  } catch (const std::runtime_error& error) {
    message = error.what();
  }
  const bool told = ::write(out, message.data(), message.size()) > 0;
  std::exit(told ? 0 : 1);  // not _exit: the libraries' exit handlers are part of the test
}

}  // namespace

std::string error_on_full_disk(std::size_t limit_bytes, const std::function<void()>& work) {
  int ends[2];
  if (::pipe(ends) != 0) throw std::runtime_error("cannot make a pipe");
  const pid_t child = ::fork();
  if (child == 0) run_child(limit_bytes, work, ends[1]);
  ::close(ends[1]);
  std::string message;
  char block[4096];
  for (ssize_t got; (got = ::read(ends[0], block, sizeof(block))) > 0;) {
    message.append(block, static_cast<std::size_t>(got));
  }
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? message : "crashed";
}

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace eventgan::testing

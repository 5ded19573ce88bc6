#include "tests/end_to_end/interposer/failure_rule.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

namespace eventgan::interposer {
namespace {

constexpr std::array kKindNames = {"open",     "shut",   "create", "write",  "sync", "close",
                                   "truncate", "rename", "link",   "unlink", "mkdir"};

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

[[noreturn]] void reject(const std::string& rule) {
  std::fprintf(stderr, "expected ACTION KIND NUMBER in EVENTGAN_FAILING_RULE, got '%s'\n",
               rule.c_str());
  std::abort();
}

/// What the environment asks for, and the calls so far.
class Watch {
 public:
  Watch()
      : folder_(environment("EVENTGAN_FAILING_FOLDER")),
        log_(static_cast<int>(::syscall(SYS_openat, AT_FDCWD,
                                        environment("EVENTGAN_FAILING_LOG").c_str(),
                                        O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666))) {
    const std::string rule = environment("EVENTGAN_FAILING_RULE");
    if (rule.empty()) return;
    std::istringstream words(rule);
    char more = '\0';
    if (!(words >> action_ >> kind_ >> number_)) reject(rule);
    if (words.get(more)) onwards_ = more == '+';
    words >> delay_us_;
    const std::map<std::string, int> errors = {
        {"ENOSPC", ENOSPC}, {"EIO", EIO}, {"EDQUOT", EDQUOT}, {"EROFS", EROFS}};
    const std::map<std::string, int> signals = {
        {"SIGTERM", SIGTERM}, {"SIGINT", SIGINT}, {"SIGUSR1", SIGUSR1}};
    const std::set<std::string> others = {"short", "kill-before", "kill-within", "kill-after",
                                          "kill-later"};
    if (const auto error = errors.find(action_); error != errors.end()) {
      error_ = error->second;
    } else if (const auto signal = signals.find(action_); signal != signals.end()) {
      signal_ = signal->second;
    } else if (!others.contains(action_)) {
      reject(rule);
    }
  }

  const std::string& folder() const { return folder_; }

  Order announce(CallKind kind, const std::string& path) {
    const std::string name = kKindNames.at(static_cast<std::size_t>(kind));
    std::unique_lock lock(mutex_);
    ++counts_[name];
    const bool changes = kind != CallKind::kOpen && kind != CallKind::kShut;
    if (changes) ++counts_["any"];
    const bool counts = kind_ == name || (kind_ == "any" && changes);
    const bool spared = error_ != 0 && kind_ == "any" && kind == CallKind::kUnlink;
    const bool meant =
        counts && !spared && (onwards_ ? counts_[kind_] >= number_ : counts_[kind_] == number_);
    // Logged before a kill, and by a bare system call, which nobody watches.
    const std::string line = name + "\t" + path + (meant ? "\t" + action_ : "") + "\n";
    if (log_ >= 0) ::syscall(SYS_write, log_, line.data(), line.size());
    if (!meant) return {};
    if (action_ == "kill-before") kill_process();
    if (action_ == "kill-later") {
      std::thread([delay = std::chrono::microseconds(delay_us_)] {
        std::this_thread::sleep_for(delay);
        kill_process();
      }).detach();
    }
    if (signal_ != 0) ::kill(::getpid(), signal_);
    return {error_, action_ == "short" || action_ == "kill-within",
            action_ == "kill-within" || action_ == "kill-after"};
  }

 private:
  std::string folder_;
  int log_;
  std::string action_;
  std::string kind_;
  long number_ = 0;
  bool onwards_ = false;
  long delay_us_ = 0;
  int error_ = 0;
  int signal_ = 0;
  std::mutex mutex_;
  std::map<std::string, long> counts_;
};

/// Never destroyed: files are closed until the very end of the process.
Watch& watch() {
  static Watch& only = *new Watch;
  return only;
}

}  // namespace

bool is_watched(const std::string& path) {
  const std::string& folder = watch().folder();
  return !folder.empty() && path.starts_with(folder) &&
         (path.size() == folder.size() || path[folder.size()] == '/');
}

Order announce(CallKind kind, const std::string& path) { return watch().announce(kind, path); }

void kill_process() {
  ::kill(::getpid(), SIGKILL);
  for (;;) ::pause();
}

}  // namespace eventgan::interposer

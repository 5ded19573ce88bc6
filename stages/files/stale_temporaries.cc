#include "stages/files/stale_temporaries.h"

#include <signal.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "stages/files/temporary_name.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A process of another user answers EPERM: it is alive.
bool is_dead(pid_t pid) { return ::kill(pid, 0) != 0 && errno == ESRCH; }

}  // namespace

std::vector<fs::path> remove_stale_temporaries(const fs::path& folder) {
  const std::string host = host_name();
  std::vector<fs::path> stale;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const auto name = parse_temporary_name(entry->path().filename().string(), host);
    if (name && is_dead(name->pid)) stale.push_back(entry->path());
  }
  if (error) throw std::runtime_error("cannot list " + folder.string() + ": " + error.message());

  // Another process may be cleaning as well; what is gone already does not count.
  std::erase_if(stale, [&](const fs::path& file) { return !fs::remove(file, error); });
  std::sort(stale.begin(), stale.end());
  return stale;
}

}  // namespace eventgan

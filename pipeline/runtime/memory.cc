#include "pipeline/runtime/memory.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <string_view>

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The process's control group of version 2 ("0::/PATH"), or the root where there is none.
fs::path own_group() {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (line.starts_with("0::/")) return line.substr(4);
  }
  return {};
}

}  // namespace

std::size_t group_memory_limit_bytes(const fs::path& root, const fs::path& group,
                                     std::size_t most) {
  std::size_t least = most;
  for (fs::path place = group.relative_path();; place = place.parent_path()) {
    std::ifstream file(root / place / "memory.max");
    std::size_t limit = 0;
    if (file >> limit) least = std::min(least, limit);  // "max" is no number
    if (place.empty()) return least;
  }
}

std::size_t memory_limit_bytes() {
  const auto pages = static_cast<std::size_t>(std::max(sysconf(_SC_PHYS_PAGES), 1L));
  const auto page_bytes = static_cast<std::size_t>(std::max(sysconf(_SC_PAGESIZE), 1L));
  std::size_t most = pages * page_bytes;
  rlimit address_space{};
  if (getrlimit(RLIMIT_AS, &address_space) == 0) {
    most = std::min<std::size_t>(most, address_space.rlim_cur);  // RLIM_INFINITY is the largest
  }
  return group_memory_limit_bytes("/sys/fs/cgroup", own_group(), most);
}

bool restart_peak_memory() {
  malloc_trim(0);
  std::ofstream references("/proc/self/clear_refs");
  references << "5" << std::flush;  // proc(5): the peak becomes what is resident now
  return references.good();
}

std::size_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    constexpr std::string_view kPeak = "VmHWM:";
    if (line.starts_with(kPeak)) return 1024 * std::stoull(line.substr(kPeak.size()));  // in kB
  }
  return 0;
}

namespace {

constexpr int kBig = 1 << 30;  // bytes; larger ones still go back at once

}  // namespace

void keep_big_buffers() {
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, kBig);
  mallopt(M_TRIM_THRESHOLD, kBig);
}

}  // namespace eventgan

#include "pipeline/runtime/memory.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <string_view>

#include "pipeline/runtime/control_groups.h"

namespace eventgan {

std::size_t memory_limit_bytes(const std::filesystem::path& root) {
  const auto pages = static_cast<std::size_t>(std::max(sysconf(_SC_PHYS_PAGES), 1L));
  const auto page_bytes = static_cast<std::size_t>(std::max(sysconf(_SC_PAGESIZE), 1L));
  std::size_t most = pages * page_bytes;
  rlimit address_space{};
  if (getrlimit(RLIMIT_AS, &address_space) == 0) {
    most = std::min<std::size_t>(most, address_space.rlim_cur);  // RLIM_INFINITY is the largest
  }
  return std::min<std::size_t>(most, control_group_limits(root).memory_bytes);
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

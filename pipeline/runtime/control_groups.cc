#include "pipeline/runtime/control_groups.h"

#include <algorithm>
#include <fstream>
#include <string>

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Takes the numbers that files have; "max" is none, and neither is what is not there.
void take(GroupLimits& limits, const fs::path& memory, const fs::path& quota,
          const fs::path& period) {
  std::uint64_t bytes = 0;
  if (std::ifstream(memory) >> bytes) limits.memory_bytes = std::min(limits.memory_bytes, bytes);
  double granted_us = 0;
  double of_us = 0;
  std::ifstream times(quota);
  if (!(times >> granted_us) || granted_us <= 0) return;  // -1 in version 1: any number
  if (!(times >> of_us) && !(std::ifstream(period) >> of_us)) return;
  if (of_us > 0) limits.processors = std::min(limits.processors, granted_us / of_us);
}

}  // namespace

GroupLimits control_group_limits(const fs::path& root) {
  const fs::path mounts = root / "sys/fs/cgroup";
  GroupLimits limits;
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {  // NUMBER:CONTROLLERS:PATH
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == line.npos || second == line.npos) continue;
    // A comma at both ends, so that "cpu" is not found in "cpuset".
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool has_memory = controllers.find(",memory,") != controllers.npos;
    const bool has_cpu = controllers.find(",cpu,") != controllers.npos;
    const fs::path group = fs::path(line.substr(second + 1)).lexically_normal().relative_path();
    for (fs::path place = group;; place = place.parent_path()) {
      if (controllers == ",,") {
        take(limits, mounts / place / "memory.max", mounts / place / "cpu.max", {});
      }
      if (has_memory) take(limits, mounts / "memory" / place / "memory.limit_in_bytes", {}, {});
      if (has_cpu) {
        const fs::path folder = mounts / "cpu" / place;
        take(limits, {}, folder / "cpu.cfs_quota_us", folder / "cpu.cfs_period_us");
      }
      if (place.empty()) break;
    }
  }
  return limits;
}

}  // namespace eventgan

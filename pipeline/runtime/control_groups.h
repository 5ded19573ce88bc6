#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>

namespace eventgan {

/// What control groups (a container, a batch job) leave to this process.
struct GroupLimits {
  std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max();  ///< the largest: any
  double processors = std::numeric_limits<double>::infinity();  ///< 1.5: one and a half at a time
};

/// The tightest limits among the groups that ROOT/proc/self/cgroup names and all above them, which
/// lie below ROOT/sys/fs/cgroup: of version 2 memory.max and cpu.max, of version 1
/// memory/memory.limit_in_bytes and cpu/cpu.cfs_quota_us with cpu/cpu.cfs_period_us. A container
/// may see its own group as the topmost one, under another name than the file says: what is not
/// there says nothing. `root` is "/" but for tests. Thread safe.
GroupLimits control_group_limits(const std::filesystem::path& root = "/");

}  // namespace eventgan

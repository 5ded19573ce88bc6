#pragma once

#include <filesystem>
#include <vector>

#include "stages/files/temporary_name.h"

namespace eventgan {

/// Whether the process that writes a temporary file lives.
enum class WriterLife {
  kAlive,   ///< this host and pid namespace have a process of its number
  kDead,    ///< of this host, and gone
  kUnknown  ///< of another host: only its file's age tells
};

/// "alive", "dead" or "unknown".
const char* to_string(WriterLife life);

/// A temporary file in an output folder: a shard under way, or what a dead writer left.
struct UnfinishedFile {
  std::filesystem::path path;
  TemporaryName name;
  WriterLife writer = WriterLife::kUnknown;
  double silent_s = 0;  ///< since its last write, by this machine's clock; ≥ 0
};

/// A writer that has not written for so long counts as dead: of another host nothing else is known,
/// and on this one the number of a dead process may meanwhile be that of an unrelated one.
inline constexpr double kSilenceOfTheDead_s = 3600;

/// The temporaries in `folder` (not below it), sorted by path. One with this process's own number
/// that was last written before this process began is another's, dead: the first process of a
/// container that is started anew has the same number each time. Throws std::runtime_error naming
/// the folder if it cannot be listed. Thread safe.
std::vector<UnfinishedFile> unfinished_files(const std::filesystem::path& folder);

/// Whether its writer is dead, as far as can be known.
bool is_stale(const UnfinishedFile& file);

}  // namespace eventgan

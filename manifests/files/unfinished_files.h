#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

// What is between steps 1 and 4 of atomic_file.h: files under way, and what dead writers left.

/// Name of a file that is being written: ".NAME.HOST.PID.ATTEMPT.tmp", so that everyone can tell
/// whose it is.
struct TemporaryName {
  std::string target;  ///< name of the file it will become
  std::string host;    ///< without dots, see host_name
  pid_t pid = 0;
  unsigned attempt = 0;  ///< counts within the process
  bool operator==(const TemporaryName&) const = default;
};

std::string to_string(const TemporaryName& name);

/// The parts of a temporary file's name, made on any host; nothing for any other name.
std::optional<TemporaryName> parse_temporary_name(std::string_view name);

/// Where a pid means something: this machine's name and the number of the process's pid namespace
/// (containers on one machine may share its name and not its pids), without dots: "node7_lab-12".
std::string host_name();

/// `machine` as part of a file name and free of dots: these and slashes become underlines, which no
/// valid machine name has.
std::string without_dots(std::string machine);

/// Whether the process that writes a temporary file lives.
enum class WriterLife {
  kAlive,   ///< this host and pid namespace have a process of its number, no zombie
  kDead,    ///< of this host, and gone or a zombie
  kUnknown  ///< of another host: only its file's age tells
};

/// "alive", "dead" or "unknown".
const char* to_string(WriterLife life);

/// A temporary file in an output folder: a shard under way, or what a dead writer left.
struct UnfinishedFile {
  std::filesystem::path path;
  TemporaryName name;
  WriterLife writer = WriterLife::kUnknown;
  double silent_s =
      0;  ///< since its last write, by this machine's clock; negative if that is ahead
};

/// A writer that has not written for so long counts as dead: of another host nothing else is known,
/// and on this one the number of a dead process may meanwhile be that of an unrelated one. So does
/// one whose last write is so far ahead of this machine's clock: its file would never grow old.
inline constexpr double kSilenceOfTheDead_s = 3600;

/// The temporaries in `folder` (not below it), sorted by path. One with this process's own number
/// that was last written before this process began is another's, dead: the first process of a
/// container that is started again has the same number each time. Throws std::runtime_error naming
/// the folder if it cannot be listed. Thread safe.
std::vector<UnfinishedFile> unfinished_files(const std::filesystem::path& folder);

/// Whether its writer is dead, as far as can be known.
bool is_stale(const UnfinishedFile& file);

/// Deletes the temporary files in `folder` (not below it) whose writers are dead, as is_stale
/// tells, of the file named `target` or, where that is empty, of all; every other file stays. Gives
/// the deleted paths, sorted. Throws std::runtime_error naming the folder if it cannot be listed.
std::vector<std::filesystem::path> remove_stale_temporaries(const std::filesystem::path& folder,
                                                            std::string_view target = {});

}  // namespace eventgan

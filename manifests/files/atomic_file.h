#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace eventgan {

// How every file that this program writes comes to be under its name whole or not at all
// (manifests/guides/guarantees.md):
//
//   1. Create a temporary of a name that no other writer uses, beside the target:
//      FOLDER/.NAME.HOST.PID.ATTEMPT.tmp.
//   2. Write it, and close it where somebody else than AtomicFile writes; each write and close is
//      checked.
//   3. fsync it, so that the bytes are on disk before the name is.
//   4. rename() it to FOLDER/NAME. That replaces: of two processes that write the same file, each
//      publishes a whole one. Where a file must not be replaced, link() it, which fails if one is
//      there.
//   5. fsync FOLDER, so that the name is on disk before anything can say so.
//
// What fails before step 4 is thrown, the temporary is removed, and the target is what it was; if
// step 5 fails, the whole file has its name, but a power cut may take it. After a kill -9 or a
// power cut before step 4 the temporary stays, with a name that says whose it was: the next run
// removes it (unfinished_files.h).
//
// Errors of the system are std::system_error, a std::runtime_error, "cannot DO PATH: REASON". The
// program ignores SIGXFSZ, so that a file that would pass the process's limit (ulimit -f) is one of
// them, too.

/// Throws the std::system_error "WHAT: REASON" of an errno; of EFBIG with the process's limit of a
/// file's size, if it has one.
[[noreturn]] void throw_system_error(const std::string& what, int error);

/// Why a library that does not say so may have failed to write `file`: that it has come to the
/// process's limit of a file's size, else " (is the disk full?)".
std::string unsaid_reason(const std::filesystem::path& file);

/// A file on its way through the steps above. Thread safety: one thread at a time.
class AtomicFile {
 public:
  /// Chooses the temporary's name. Made it is by `create`, or by a library that writes files by
  /// itself.
  explicit AtomicFile(std::filesystem::path target);

  /// Removes the temporary, unless that has the target's name by now.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& target() const { return target_; }
  const std::filesystem::path& temporary() const { return temporary_; }

  /// Steps 1 and 2 for bytes.
  void create();
  void write(std::string_view bytes);

  /// Puts `bytes` in the place of as many that were written before, from `byte` on.
  void overwrite(std::int64_t byte, std::string_view bytes);

  /// Step 3, for those who want to hash what is on disk.
  void sync();

  /// Steps 3, unless that is done, to 5. Once.
  void publish();

  /// The same, but only if the target does not exist; false if it does.
  bool publish_if_absent();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  int descriptor_ = -1;  ///< of the temporary, while it is written here
  bool synced_ = false;
};

/// Writes `text` as `target`, in place of what was there.
void write_file_atomically(const std::filesystem::path& target, std::string_view text);

/// Takes a file's text piece by piece; pieces should be large.
using TextSink = std::function<void(std::string_view)>;

/// Writes a text that need not be in memory, but only if `target` does not exist; false (and
/// nothing changed) if it does. Of two processes that race, one wins. `write` is called with the
/// sink to give the text to, unless `target` exists already. What it throws is passed on, and
/// nothing has changed.
bool create_file_atomically(const std::filesystem::path& target,
                            const std::function<void(const TextSink&)>& write);

// The steps alone, for what is no new file (a backup that is put back, a checkpoint that moves on).

/// Step 1's name, never given twice.
std::filesystem::path temporary_beside(const std::filesystem::path& target);

/// Throws std::runtime_error naming it if a part of FOLDER/RELATIVE below FOLDER is a symbolic
/// link: what is written or removed there would be somewhere else. FOLDER itself may be one, as its
/// user has named it; what is not there is none. Thread safe.
void require_no_link(const std::filesystem::path& folder, const std::filesystem::path& relative);

/// fsync of a file or a folder.
void sync_to_disk(const std::filesystem::path& path);

/// Steps 4 and 5: afterwards `target` is whole, also after a power cut.
void publish(const std::filesystem::path& temporary, const std::filesystem::path& target);

}  // namespace eventgan

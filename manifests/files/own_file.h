#pragma once

#include <filesystem>
#include <string_view>

namespace eventgan {

/// What the program writes where a person's files may be, and recognises again by what stands in
/// it. The rows are in own_file.cc.
enum class OwnFile {
  kPlan,
  kRunRecord,
  kAmendments,
  kEventIndex,
  kShard,
  kCommitRecord,
  kDescription,
  kView,
  kReport,
  kWeights,
  kCheckpoint,
  kTrainingLock,
  kTrainingTable,
  kValidationTable,
  kChart,
  kSensor,
  kTradeoffReport,
  kTradeoffTable,
  kPicture,
  kVideo,
  kTrace,
};

/// Whether `file` may be written as `kind`: nothing is there, an empty file, or one that the
/// program wrote as that kind. Of a damaged file what is left of it decides. Throws
/// std::runtime_error if it cannot be read.
bool is_replaceable(const std::filesystem::path& file, OwnFile kind);

/// Whether a file with this beginning is one that the program wrote, of any kind, as far as that
/// shows it.
bool has_own_mark(std::string_view beginning);

/// Whether a folder is an export, or an output folder of `convert` or `plan` with nothing but their
/// results: no images, labels or recordings, and of folders only such ones. A search for images,
/// labels and recordings passes over it.
bool is_own_output(const std::filesystem::path& folder);

/// Throws UsageError "expected ..., or no file, got another file, in PATH" unless is_replaceable.
/// Every command asks it of all that it is about to write, before it writes anything: no person's
/// file is replaced or removed. Thread safe.
void require_replaceable(const std::filesystem::path& file, OwnFile kind);

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/planning/draft_manifest.h"

namespace CLI {
class App;
}

namespace eventgan {

/// The name and the help of what read_given_job takes.
inline constexpr char kGivenJob[] = "MANIFEST|FOLDER|VIDEO";
inline constexpr char kGivenJobText[] =
    "The manifest of the job (examples: manifests/examples); or a folder, video or recording, of "
    "which the job is what eventgan init proposes; where the plan is written, that manifest is "
    "kept "
    "as manifest.json in the output folder";

/// What is said of a job that is given without a manifest.
struct GivenWishes {
  DraftWishes draft = {};
  std::optional<std::string> sensor = {};  ///< WIDTHxHEIGHT, of a recording

  /// The options again, each with a space before it.
  std::string text() const;
};

/// --camera, --classes, --no-labels
void add_draft_options(CLI::App& command, DraftWishes& wishes);

/// These and --sensor.
void add_wishes_options(CLI::App& command, GivenWishes& wishes);

/// A job as a command line gives it.
struct GivenJob {
  JobManifest manifest;
  std::filesystem::path output;  ///< the job's folder, if no other was given
  /// What was found, or which manifest is taken, a line each; none of a manifest that was given.
  /// To be told once the job is planned: until then another program may begin again (HandOver).
  std::vector<std::string> findings;
  /// Where keep_manifest is to write the manifest; none: it is there.
  std::optional<std::filesystem::path> unwritten;
};

/// The job of a manifest; or that of a folder or video (may_be_source), by the manifest that
/// draft_manifest writes for it, with absolute paths, or that an earlier run has kept as
/// manifest.json in the output folder: it stays as it is, whatever becomes of the source. `output`:
/// --output; without it a folder's job goes to out/NAME, which starts at the program's own folder
/// as that of a manifest in it would. Writes nothing.
///
/// Throws UsageError or InputError as read_job_manifest, find_source and draft_manifest do;
/// InputError if nothing found makes a pair, or labels lie there that are not read
/// (FoundSource::unread); UsageError if the output folder has the manifest of
/// another source or of other wishes, or a job that was given by a manifest elsewhere; for wishes
/// that do not fit what was given.
GivenJob read_given_job(const std::filesystem::path& given,
                        const std::optional<std::filesystem::path>& output,
                        const GivenWishes& wishes = {});

/// Where the job is made: `output` (--output), or else its own folder, or for a trial of `limit`
/// pairs OUT-trial-20 beside that.
std::filesystem::path job_folder(const GivenJob& job,
                                 const std::optional<std::filesystem::path>& output,
                                 std::optional<std::int64_t> limit);

/// Keeps the manifest before the job's plan is frozen, if that is left to do, and tells where. Of
/// several workers that begin at once one writes it. Throws UsageError if that one wrote another,
/// since the source has changed meanwhile; std::runtime_error if it cannot be written.
void keep_manifest(const GivenJob& job);

}  // namespace eventgan

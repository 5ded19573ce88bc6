#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "pipeline/runtime/progress.h"
#include "pipeline/runtime/trace.h"

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace eventgan {

// Options that several commands have, each declared once. What takes a value must outlive the
// parsing.

/// Numbers from `least` to `most`; not NaN, which CLI::Range lets pass.
CLI::Validator finite_range(double least, double most);

/// DIR, a folder that convert has written.
void add_folder_argument(CLI::App& command, std::filesystem::path& folder);

/// OUT, the same, or its dataset.h5, or a shard of it.
void add_shards_argument(CLI::App& command, std::filesystem::path& where);

/// --frames DIR, where paths of frames begin.
void add_frames_option(CLI::App& command, std::filesystem::path& folder);

/// --threads NUMBER; 0: all cores.
void add_threads_option(CLI::App& command, int& threads);

/// --grace SECONDS, of a run that makes shards.
void add_grace_option(CLI::App& command, double& grace_s);

/// --limit N: of a trial, into another folder (job_folder).
void add_limit_option(CLI::App& command, std::optional<std::int64_t>& limit);

/// --json
void add_json_option(CLI::App& command, bool& json);

/// --progress STYLE
void add_progress_option(CLI::App& command, ProgressStyle& style);

/// Progress on the standard error stream.
std::unique_ptr<Progress> show_progress(ProgressStyle style, std::int64_t total,
                                        const ProgressUnit& unit = {});

/// The same for the phases beside what a command counts.
ShowPhase show_phases(ProgressStyle style);

/// What every command takes that makes a folder of files by a manifest.
struct JobOptions {
  std::string manifest;
  std::optional<std::filesystem::path> output;  ///< to write to instead of the manifest's
  int threads = 0;
  bool overwrite = false;
  ProgressStyle progress = ProgressStyle::kAuto;

  bool as_json() const { return progress == ProgressStyle::kJson; }
};

/// Adds the manifest under the name `what`, --output, --threads, --overwrite and --progress; the
/// texts are the help of the manifest and --overwrite.
void add_job_options(CLI::App& command, JobOptions& options, const std::string& what,
                     const std::string& what_text, const std::string& overwrite_text);

/// --profile FILE
void add_profile_option(CLI::App& command, std::optional<std::string>& file);

/// What a command is traced as.
struct ProfiledCommand {
  std::optional<std::string> file;  ///< of the trace; none: not asked for
  std::string name;
  std::filesystem::path output;  ///< the folder of shards, in which no trace may lie
};

/// Runs a command's work with a trace, or with none (null) if no file was given; its exit code. The
/// trace is completed also when the work throws or was stopped; where it is, or why there is none,
/// is reported on the standard error stream. A trace that is lost while the work goes on costs
/// nothing else: the exit code stays. Throws UsageError before the work if the file cannot be.
int run_profiled(const ProfiledCommand& command, const std::function<int(TraceRecorder*)>& work);

/// stopping_line of a run that makes shards, which get so many seconds after a request to stop.
std::string shard_stopping_line(double grace_s);

}  // namespace eventgan

#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "pipeline/profile/trace_recorder.h"

namespace CLI {
class App;
}

namespace eventgan {

/// Adds `--profile FILE` to a command; `file` must outlive its parsing.
void add_profile_option(CLI::App& command, std::optional<std::string>& file);

/// What a command is traced as.
struct ProfiledCommand {
  std::optional<std::string> file;  ///< of the trace; none: not asked for
  std::string name;
  std::filesystem::path output;  ///< the folder of shards, in which no trace may lie
};

/// Runs a command's work with a trace, or with none (null) if no file was given; its exit code. The
/// trace is completed also when the work throws or was stopped; where it is, or why there is none,
/// is told on the standard error stream. A trace that is lost while the work goes on costs nothing
/// else: the exit code stays. Throws UsageError before the work if the file cannot be.
int run_profiled(const ProfiledCommand& command, const std::function<int(TraceRecorder*)>& work);

}  // namespace eventgan

#include "pipeline/commands/profile_option.h"

#include <CLI/CLI.hpp>
#include <exception>
#include <system_error>

#include "manifests/faults.h"
#include "pipeline/commands/standard_streams.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/profile/trace_watch.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

void refuse_output_folder(const ProfiledCommand& command) {
  std::error_code error;  // of a path that leads nowhere; TraceFile has a word for it
  const fs::path file = fs::weakly_canonical(fs::absolute(command.file.value(), error), error);
  const fs::path output = fs::weakly_canonical(fs::absolute(command.output, error), error);
  if (error || file.parent_path() != output) return;
  throw UsageError("--profile: expected a file outside the folder of the shards, got " +
                   command.file.value());
}

void finish(TraceRecorder& trace, const ProfiledCommand& command) {
  try {
    trace.finish();
    tell("trace of every stage and thread: " + *command.file +
         " (open it in https://ui.perfetto.dev, chrome://tracing or https://www.speedscope.app)");
  } catch (const std::exception& error) {
    tell_warning(std::string("no trace: ") + error.what());
  }
}

}  // namespace

void add_profile_option(CLI::App& command, std::optional<std::string>& file) {
  command
      .add_option("--profile", file,
                  "Write a trace of every stage and thread, for Perfetto, chrome://tracing or "
                  "speedscope")
      ->option_text("FILE");
}

int run_profiled(const ProfiledCommand& command, const std::function<int(TraceRecorder*)>& work) {
  if (!command.file) return work(nullptr);
  refuse_output_folder(command);
  TraceRecorder trace(*command.file,
                      {{"program", program_version()}, {"command", "eventgan " + command.name}});
  int exit_code = 0;
  try {
    const TraceWatch watch(trace);
    exit_code = work(&trace);
  } catch (...) {
    finish(trace, command);
    throw;
  }
  finish(trace, command);
  return exit_code;
}

}  // namespace eventgan

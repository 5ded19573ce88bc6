#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "manifests/values/job.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/conversion/retry.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "pipeline/runtime/trace.h"

namespace eventgan {
namespace {

struct RetryArguments {
  std::filesystem::path folder;
  std::optional<std::string> manifest;
  int threads = 0;
  double grace_s = RunOptions().grace_s;
  std::optional<std::string> profile;
  ProgressStyle progress = ProgressStyle::kAuto;

  bool as_json() const { return progress == ProgressStyle::kJson; }
};

int finish(const RetryArguments& arguments, const RetryReport& report, const ErrorSpec& errors) {
  std::cout << (arguments.as_json() ? to_json(report) : to_text(report)) << std::flush;
  if (report.stopped) return kStopped;
  if (report.too_many_faults) {
    tell_error(fmt::format("expected {}, got {} of {}", limits_text(errors, report.planned),
                           report.quarantined, report.planned));
    return kTooManyFaults;
  }
  return report.damaged_shards.empty() ? kComplete : kFailed;
}

int run(const RetryArguments& arguments, const StopSignal& signal, TraceRecorder* trace) {
  const FrozenOutline frozen = read_frozen_outline(arguments.folder);
  const JobManifest manifest = recorded_manifest(arguments.folder, frozen.plan, arguments.manifest);
  RunOptions options;
  options.threads = arguments.threads;
  options.grace_s = arguments.grace_s;
  options.show_phase = show_phases(arguments.progress);
  options.warn = tell_warning;
  options.trace = trace;
  options.since_stop_request = [&] { return signal.seconds_since_request(); };
  if (const auto report = nothing_to_retry(arguments.folder, frozen, manifest, options)) {
    return finish(arguments, *report, {});
  }
  const LoadedGenerator loaded = [&] {
    const TraceSpan span(trace, "load generator", "job");
    return load_generator(manifest);
  }();
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total);
  };
  const RetryReport report =
      retry(arguments.folder, manifest, *loaded.generator, loaded.weights_hash, options);
  return finish(arguments, report, manifest.errors);
}

}  // namespace

void add_retry_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("retry",
                         "Make quarantined samples again\nFor use after their inputs have been "
                         "fixed. Good samples stay as they are; classes that labels have "
                         "gained are named in all shards of their source.");
  const auto arguments = std::make_shared<RetryArguments>();
  add_folder_argument(*command, arguments->folder);
  command
      ->add_option("--manifest", arguments->manifest,
                   "The job's manifest, if its folder has moved; default: as recorded in DIR")
      ->option_text("FILE");
  add_threads_option(*command, arguments->threads);
  add_grace_option(*command, arguments->grace_s);
  add_progress_option(*command, arguments->progress);
  add_profile_option(*command, arguments->profile);
  command->callback([arguments, &exit_code] {
    const StopSignal signal(shard_stopping_line(arguments->grace_s));
    exit_code = run_profiled({arguments->profile, "retry", arguments->folder},
                             [&](TraceRecorder* trace) { return run(*arguments, signal, trace); });
  });
}

}  // namespace eventgan

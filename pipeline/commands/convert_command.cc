#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>

#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "pipeline/command_line/given_job.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "pipeline/runtime/trace.h"
#include "stages/frames/sources/find_source.h"

namespace eventgan {
namespace {

struct ConvertArguments {
  JobOptions job;
  std::optional<std::string> shards;
  GivenWishes wishes;
  std::optional<std::int64_t> limit;
  bool no_finalize = false;
  double grace_s = ConversionOptions().grace_s;
  std::optional<std::string> profile;
};

int judge(const ConversionReport& report, const ErrorSpec& errors) {
  if (report.too_many_faults) {
    tell_error(fmt::format("expected {}, got {} of {}", limits_text(errors, report.plan_pairs),
                           report.quarantined_in_plan(), report.plan_pairs));
    return kTooManyFaults;
  }
  if (report.complete()) return kComplete;
  return report.stopped ? kStopped : kFailed;
}

namespace fs = std::filesystem;

/// What a trial leaves to do, for a person.
std::string trial_text(const ConvertArguments& arguments, const ConversionReport& report) {
  const JobOptions& job = arguments.job;
  return fmt::format("trial run: {} of the job. For all pairs{}:  eventgan convert {}{}{}\n",
                     count_text(report.plan_pairs, "pair"),
                     job.output ? ", into another folder" : "", shell_word(job.manifest),
                     arguments.wishes.text(), job.output ? " --output DIR" : "");
}

/// Completes the dataset as `eventgan finalize` does; false, and says why, if a shard is gone
/// again.
bool is_finalized(const JobOptions& job, const fs::path& folder) try {
  FinalizationOptions options;
  options.show_phase = show_phases(job.progress);
  const FinalizationReport report = finalize(folder, options);
  if (!report.complete()) tell_error(to_text(report));
  return report.complete();
} catch (const InputError& error) {  // of the shards, which are no input here
  throw std::runtime_error(error.what());
}

int convert_and_report(const ConvertArguments& arguments, const GivenJob& given,
                       ConversionOptions options) {
  const JobOptions& job = arguments.job;
  const JobManifest& manifest = given.manifest;
  const LoadedGenerator loaded = [&] {
    const TraceSpan span(options.trace, "load generator", "job");
    return load_generator(manifest);
  }();
  // Here, and not in every command that loads them: `plan` writes nothing, and `retry` goes on. Not
  // before the plan, which may be another program's to make (HandOver).
  options.on_planned = [&] {
    if (!job.output && !given.findings.empty()) {  // of a folder: a manifest says where itself
      tell("output folder: " + options.output->string() + " (--output DIR names another)");
    }
    for (const std::string& line : given.findings) tell(line);
    keep_manifest(given);
    if (!loaded.choice.empty()) tell(loaded.choice);
    for (const std::string& warning : loaded.warnings) tell_warning(warning);
  };
  ConversionReport report = convert(manifest, *loaded.generator, loaded.weights_hash, options);
  const int code = judge(report, manifest.errors);
  const auto print = [&] {
    std::cout << (job.as_json() ? to_json(report) : to_text(report));
    if (options.limit && !job.as_json()) std::cout << trial_text(arguments, report);
    std::cout << std::flush;
  };
  // A worker with a part of the plan cannot know when the others are done.
  const bool finalizes = options.part.count == 1 && !arguments.no_finalize;
  if (code == kComplete && finalizes) {
    try {
      report.finalized = is_finalized(job, *options.output);
    } catch (...) {
      print();
      throw;
    }
  }
  print();
  return code == kComplete && !report.finalized && finalizes ? kFailed : code;
}

int run(const ConvertArguments& arguments) {
  const JobOptions& job = arguments.job;
  const StopSignal signal(shard_stopping_line(arguments.grace_s));
  const GivenJob given = read_given_job(job.manifest, job.output, arguments.wishes);
  ConversionOptions options;
  options.part = choose_part(arguments.shards, [](const char* name) { return std::getenv(name); });
  options.grace_s = arguments.grace_s;
  options.since_stop_request = [&] { return signal.seconds_since_request(); };
  options.limit = arguments.limit;
  const fs::path folder = job_folder(given, job.output, options.limit);
  options.output = folder;
  options.threads = job.threads;
  options.overwrite = job.overwrite;
  options.make_progress = [&](std::int64_t total) { return show_progress(job.progress, total); };
  options.show_phase = show_phases(job.progress);
  options.warn = tell_warning;
  options.note = [](const std::string& text) { tell(text); };
  return run_profiled({arguments.profile, "convert", folder}, [&](TraceRecorder* trace) {
    options.trace = trace;
    return convert_and_report(arguments, given, options);
  });
}

}  // namespace

void add_convert_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "convert",
      "Convert labelled frames into shards\nTurns each pair of frames into an event volume "
      "(a voxel grid of events) with the labels of its labelled frame, and completes the dataset "
      "as "
      "`finalize` does. Run the same command again to resume. Several workers can share the output "
      "folder. On SIGTERM, SIGINT or SIGUSR1 the "
      "current shard is finished or dropped, and the exit code is 75.");
  const auto arguments = std::make_shared<ConvertArguments>();
  add_job_options(*command, arguments->job, kGivenJob, kGivenJobText,
                  "Discard the results of earlier runs of the same job");
  command->get_option("--output")
      ->description(
          "Output folder; default: the manifest's, of a folder or video out/NAME-events "
          "in the current folder");
  command
      ->add_option("--shards", arguments->shards,
                   "This worker's part of the plan: I/N (0 <= I < N) or all; default: as set in "
                   "the environment by SHARD_INDEX, Slurm, Kubernetes or Open MPI, otherwise all")
      ->option_text("I/N");
  add_limit_option(*command, arguments->limit);
  command->add_flag("--no-finalize", arguments->no_finalize,
                    "Leave dataset.json and dataset.h5 to `eventgan finalize`; so does a part");
  add_wishes_options(*command, arguments->wishes);
  add_grace_option(*command, arguments->grace_s);
  add_profile_option(*command, arguments->profile);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

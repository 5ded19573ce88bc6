#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "manifests/documents/json_text.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/command_line/given_job.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/conversion/plan_summary.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/threads.h"
#include "stages/frames/sources/find_source.h"
#include "stages/recordings/order/event_index.h"

namespace eventgan {
namespace {

struct PlanArguments {
  std::string manifest;
  int threads = 0;
  bool json = false;
  bool freeze = false;
  std::optional<std::string> output;
  GivenWishes wishes;
  std::optional<std::int64_t> limit;
  ProgressStyle progress = ProgressStyle::kAuto;
};

/// What a script needs to know before it submits a job for each shard.
void print_frozen(const std::filesystem::path& folder, const FrozenPlan& frozen, bool as_json) {
  if (as_json) {
    const nlohmann::json json = {{"folder", folder.string()},
                                 {"plan_hash", frozen.hash},
                                 {"samples", frozen.plan.sample_count()},
                                 {"shards", frozen.plan.shards.size()}};
    std::cout << dump_json(json, JsonLayout::kIndented) << std::endl;
    return;
  }
  std::cout << "Frozen in " << (folder / "plan.json").string() << ": "
            << count_text(frozen.plan.sample_count(), "sample") << " in "
            << count_text(std::ssize(frozen.plan.shards), "shard") << std::endl;
}

int freeze(const PlanArguments& arguments, const GivenJob& given,
           const std::filesystem::path& folder, Plan plan) {
  require_own_results(folder);
  std::filesystem::create_directories(folder);
  remove_stale_temporaries(folder);
  keep_manifest(given);
  const FrozenPlan frozen = freeze_plan(folder, std::move(plan), show_phases(arguments.progress),
                                        given.manifest.directory);
  record_manifest_folder(folder, given.manifest);
  print_frozen(folder, frozen, arguments.json);
  return kComplete;
}

int run(const PlanArguments& arguments) {
  const GivenJob given = read_given_job(arguments.manifest, arguments.output, arguments.wishes);
  const JobManifest& manifest = given.manifest;
  const LoadedGenerator loaded = load_generator(manifest);
  const std::filesystem::path folder = job_folder(given, arguments.output, arguments.limit);
  EventIndexes indexes(folder / kEventIndexFile);
  PlannedJob job =
      make_plan(manifest, loaded.weights_hash, loaded.generator->description(),
                {.show_phase = show_phases(arguments.progress), .limit = arguments.limit});
  for (const std::string& line : given.findings) tell(line);
  for (const std::string& warning : job.warnings) tell_warning(warning);
  if (arguments.freeze) {
    const int exit_code = freeze(arguments, given, folder, std::move(job.plan));
    indexes.save();
    return exit_code;
  }
  const int threads = thread_count(arguments.threads);
  const bool as_json = arguments.json || arguments.progress == ProgressStyle::kJson;
  const TrialEstimate estimate = measure_trial(manifest, job, *loaded.generator, threads);
  std::cout << (as_json ? plan_summary_json : plan_text)(manifest, job, estimate, threads)
            << std::flush;
  return kComplete;
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("plan",
                         "Show what convert would do\nPrints pairs, missing frames, shards, size "
                         "and time. Writes nothing, except with --freeze.");
  const auto arguments = std::make_shared<PlanArguments>();
  command->add_option(kGivenJob, arguments->manifest, kGivenJobText)->required();
  add_wishes_options(*command, arguments->wishes);
  add_limit_option(*command, arguments->limit);
  add_threads_option(*command, arguments->threads);
  add_json_option(*command, arguments->json);
  auto* freeze_flag =
      command->add_flag("--freeze", arguments->freeze,
                        "Freeze the plan in the output folder, as the first convert does, and "
                        "print its number of shards, without measuring time and size");
  command
      ->add_option("--output", arguments->output,
                   "Folder to freeze the plan in; default: the manifest's")
      ->needs(freeze_flag);
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

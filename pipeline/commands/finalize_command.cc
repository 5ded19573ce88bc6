#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/documents/job_manifest.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/options.h"
#include "pipeline/commands/standard_streams.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct FinalizeArguments {
  std::string folder;
  std::string manifest;  ///< empty: the one in the plan
  bool partial = false;
  bool json = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const FinalizeArguments& arguments) {
  FinalizationOptions options;
  options.partial = arguments.partial;
  options.show_phase = show_phases(arguments.progress);
  if (!arguments.manifest.empty()) options.errors = read_job_manifest(arguments.manifest).errors;
  const FinalizationReport report = finalize(arguments.folder, options);
  const bool as_json = arguments.json || arguments.progress == ProgressStyle::kJson;
  std::cout << (as_json ? to_json(report) : to_text(report)) << std::flush;
  if (report.too_many_faults) {
    tell_error(
        fmt::format("expected no more quarantined samples than the manifest's errors allow, got {} "
                    "(--manifest FILE: other limits)",
                    report.counts.quarantined()));
    return kTooManyFaults;
  }
  return report.written ? kComplete : kFailed;
}

}  // namespace

void add_finalize_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "finalize",
      "Completes a dataset: checks that every shard is there and whole and writes "
      "dataset.json and dataset.h5, in which all shards read as one; exit "
      "code 1 and a line for each missing shard, 65 beyond the manifest's "
      "limits for quarantined samples");
  const auto arguments = std::make_shared<FinalizeArguments>();
  command->add_option("DIR", arguments->folder, "A folder that convert has written")->required();
  command->add_flag("--partial", arguments->partial,
                    "Write what there is even if shards are missing (dataset.json says so)");
  command
      ->add_option("--manifest", arguments->manifest,
                   "Take the limits for quarantined samples from this manifest instead of the one "
                   "that the plan was frozen with")
      ->option_text("FILE");
  command->add_flag("--json", arguments->json, "Print JSON");
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "manifests/documents/job_manifest.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct FinalizeArguments {
  std::filesystem::path folder;
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
                    "(--manifest FILE sets other limits)",
                    report.counts.quarantined()));
    return kTooManyFaults;
  }
  return report.written ? kComplete : kFailed;
}

}  // namespace

void add_finalize_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "finalize",
      "Check all shards and complete the dataset\nWrites dataset.json, and dataset.h5, which shows "
      "all shards as one. Missing or damaged shards are listed and give exit code 1; more "
      "quarantined samples than the manifest allows give exit code 65.");
  const auto arguments = std::make_shared<FinalizeArguments>();
  add_folder_argument(*command, arguments->folder);
  command->add_flag("--partial", arguments->partial,
                    "Complete the dataset even if shards are missing (dataset.json records it)");
  command
      ->add_option("--manifest", arguments->manifest,
                   "Take the limits for quarantined samples from this manifest, not from the one "
                   "that was converted")
      ->option_text("FILE");
  add_json_option(*command, arguments->json);
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <string>

#include "manifests/documents/job_manifest.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/planning/outline_masks.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"

namespace eventgan {
namespace {

struct OutlineArguments {
  std::string manifest;
  std::string out;
  int threads = 0;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const OutlineArguments& arguments) {
  const StopSignal signal(stopping_line("finishing the current images"));
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  OutlineMasksOptions options;
  options.out = arguments.out;
  options.threads = arguments.threads;
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total, {"images", /*has_bytes=*/false});
  };
  options.stop = [&] { return signal.requested(); };
  const OutlineMasksReport report = make_outline_masks(manifest, options);
  const bool as_json = arguments.progress == ProgressStyle::kJson;
  std::cout << (as_json ? to_json(report) : to_text(report)) << std::flush;
  if (beyond_limits(manifest.errors, std::ssize(report.faults), report.images)) {
    tell_error(fmt::format("expected {}, got {} of {}", limits_text(manifest.errors, report.images),
                           report.faults.size(), report.images));
    return kTooManyFaults;
  }
  return report.complete() ? kComplete : kStopped;
}

}  // namespace

void add_outline_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "outline",
      "Cut labelled objects out of their boxes\nWrites an index mask for each labelled image, to "
      "be looked at, corrected, and named as \"outlines\" in the manifest "
      "(manifests/guides/own_data.md). Outlines that labels have are drawn as they are, other "
      "boxes are cut out by GrabCut. Masks that exist are kept.");
  const auto arguments = std::make_shared<OutlineArguments>();
  command->add_option("MANIFEST", arguments->manifest, "The manifest of the job")->required();
  command->add_option("--out", arguments->out, "Folder for the masks")
      ->required()
      ->option_text("DIR");
  add_threads_option(*command, arguments->threads);
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

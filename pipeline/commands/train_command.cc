#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/documents/training_manifest.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "pipeline/training/run_training.h"

namespace eventgan {
namespace {

struct TrainArguments {
  JobOptions job;
  std::string device = "cpu";
};

int run(const TrainArguments& arguments) {
  const TrainingManifest manifest = read_training_manifest(arguments.job.manifest);
  const StopSignal signal(stopping_line("saving the state after this step"));
  TrainingOptions options;
  options.output = arguments.job.output;
  options.threads = arguments.job.threads;
  options.device = arguments.device;
  options.overwrite = arguments.job.overwrite;
  options.stop = [&] { return signal.requested(); };
  options.warn = tell_warning;
  options.note = tell_note;
  options.make_progress = [&] {
    auto progress =
        std::make_unique<TrainingProgress>(std::cerr, arguments.job.progress, terminal_columns());
    progress->keep_up();
    return progress;
  };
  const TrainingReport report = run_training(manifest, options);
  std::cout << (arguments.job.as_json() ? to_json(report) : to_text(report)) << std::flush;
  return report.complete ? kComplete : kStopped;
}

}  // namespace

void add_train_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "train",
      "Train a generator on recorded events\nSee manifests/guides/training.md. "
      "SIGINT, SIGTERM or SIGUSR1 save the state and stop; run the same command again to resume.");
  const auto arguments = std::make_shared<TrainArguments>();
  add_job_options(*command, arguments->job, "MANIFEST",
                  "The manifest of the training (example: manifests/examples/train.json)",
                  "Discard the results of earlier runs of the same training");
  command->add_option("--device", arguments->device, "cpu (default) or cuda")
      ->check(CLI::IsMember({"cpu", "cuda"}));
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

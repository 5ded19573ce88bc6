#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/documents/training_manifest.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/options.h"
#include "pipeline/commands/standard_streams.h"
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
  const StopSignal signal(stopping_line("after this step the state is saved"));
  TrainingOptions options;
  options.output = arguments.job.output_folder();
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
      "Trains a generator on event recordings with frames (manifests/guides/training.md). Stopped "
      "by SIGINT, SIGTERM or SIGUSR1 it saves its state; run again, it goes on from there");
  const auto arguments = std::make_shared<TrainArguments>();
  add_job_options(*command, arguments->job, "The training (manifests/examples has one)",
                  "Discard what an earlier run of the same training left in the folder");
  command->add_option("--device", arguments->device, "cpu or cuda; default: cpu")
      ->check(CLI::IsMember({"cpu", "cuda"}));
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "pipeline/command_line/options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "stages/synthetic/demo_dataset.h"

namespace eventgan {
namespace {

struct DemoOptions {
  std::string folder;
  std::uint64_t seed = 7;
  int scenes = 0;
  int between = 0;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const DemoOptions& options) {
  const std::string& folder = options.folder;
  {
    Phase phase(show_phases(options.progress), {"images", /*has_bytes=*/false, "drawing:"},
                demo_image_count(options.scenes));
    const StopSignal signal;
    write_demo_dataset(folder, options.seed, options.scenes, options.between, [&] {
      phase.advance();
      if (signal.requested()) throw Stopped("stopped; the unfinished dataset was removed");
    });
  }
  std::cout << "a small KITTI, MPII and Human3.6M dataset is in " << folder
            << "\nnext:  eventgan convert "
            << shell_word((std::filesystem::path(folder) / "manifest.json").string()) << std::endl;
  return kComplete;
}

}  // namespace

void add_make_demo_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "make-demo",
      "Write a small synthetic dataset and its manifest\nFor trying the program: synthetic "
      "sequences of streets with cars and of walking figures, with exact labels.");
  const auto options = std::make_shared<DemoOptions>();
  command->add_option("DIR", options->folder, "A new or empty folder")->required();
  auto* scenes =
      command
          ->add_option(
              "--scenes", options->scenes,
              "Number of street sequences and of figure sequences, a fifth of them for validation: "
              "enough to train on; default: one drive of 12 labelled frames and 7 figures")
          ->check(CLI::Range(1, 100000));
  command->add_option("--seed", options->seed, "Random seed; default: 7");
  command
      ->add_option("--between", options->between,
                   "Number of intermediate frames between a labelled frame and the previous one "
                   "(for figures also the next one), as input for eventgan simulate")
      ->check(CLI::Range(1, 1000))
      ->needs(scenes);
  add_progress_option(*command, options->progress);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace eventgan

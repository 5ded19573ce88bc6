#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "pipeline/commands/commands.h"
#include "pipeline/commands/options.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "stages/scenes/demo_dataset.h"

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
      if (signal.requested()) throw Stopped("stopped; nothing is left of the dataset");
    });
  }
  std::cout << "a small KITTI, MPII and Human3.6M dataset is in " << folder
            << "\nnext:  eventgan convert "
            << (std::filesystem::path(folder) / "manifest.json").string() << std::endl;
  return kComplete;
}

}  // namespace

void add_make_demo_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("make-demo",
                                     "Writes a small synthetic dataset with exact labels, and a "
                                     "manifest, to try the program with");
  const auto options = std::make_shared<DemoOptions>();
  command->add_option("DIR", options->folder, "A new or empty folder")->required();
  auto* scenes =
      command
          ->add_option(
              "--scenes", options->scenes,
              "So many streets with cars and so many figures, a fifth of them for validation: "
              "enough to train on; default: a drive of 12 labelled frames and 7 figures")
          ->check(CLI::Range(1, 100000));
  command->add_option("--seed", options->seed, "Other scenes for another number; default: 7");
  command
      ->add_option(
          "--between", options->between,
          "So many pictures between the frame before a labelled one and it, and for figures "
          "the frame after it: what a camera of events sees, for eventgan simulate")
      ->check(CLI::Range(1, 1000))
      ->needs(scenes);
  add_progress_option(*command, options->progress);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace eventgan

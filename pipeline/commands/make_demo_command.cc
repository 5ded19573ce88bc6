#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "stages/scenes/demo_dataset.h"

namespace eventgan {
namespace {

constexpr std::uint64_t kSeed = 7;

int run(const std::string& folder, int scenes) {
  write_demo_dataset(folder, kSeed, scenes);
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
  const auto folder = std::make_shared<std::string>();
  const auto scenes = std::make_shared<int>(0);
  command->add_option("DIR", *folder, "A new or empty folder")->required();
  command
      ->add_option("--scenes", *scenes,
                   "So many streets with cars and so many figures, a fifth of them for validation: "
                   "enough to train on; default: a drive of 12 labelled frames and 7 figures")
      ->check(CLI::Range(1, 100000));
  command->callback([folder, scenes, &exit_code] { exit_code = run(*folder, *scenes); });
}

}  // namespace eventgan

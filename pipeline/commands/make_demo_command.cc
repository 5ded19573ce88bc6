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

int run(const std::string& folder) {
  write_demo_dataset(folder, kSeed);
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
  command->add_option("DIR", *folder, "A new or empty folder")->required();
  command->callback([folder, &exit_code] { exit_code = run(*folder); });
}

}  // namespace eventgan

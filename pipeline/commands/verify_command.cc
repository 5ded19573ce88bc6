#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "pipeline/command_line/options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/dataset/verify_folder.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct VerifyArguments {
  std::filesystem::path folder;
  bool deep = false;
  std::optional<std::string> manifest;
  bool json = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

int run(const VerifyArguments& arguments) {
  const FolderCheck check =
      verify_folder(arguments.folder, {.deep = arguments.deep,
                                       .manifest = arguments.manifest,
                                       .show_phase = show_phases(arguments.progress)});
  const bool as_json = arguments.json || arguments.progress == ProgressStyle::kJson;
  std::cout << (as_json ? to_json(check, arguments.folder) : to_text(check, arguments.deep))
            << std::flush;
  return check.sound() ? kComplete : kFailed;
}

}  // namespace

void add_verify_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "verify",
      "Check every file of an output folder\nChecks hashes, structure, counts, checksums and "
      "values. Prints a line for each shard and for each fault; any fault gives exit code 1.");
  const auto arguments = std::make_shared<VerifyArguments>();
  add_folder_argument(*command, arguments->folder);
  command->add_flag("--deep", arguments->deep,
                    "Also compare pairs and labels, column by column, with the plan and, where "
                    "available, the sources");
  command
      ->add_option(
          "--manifest", arguments->manifest,
          "With --deep: the job's manifest, if its folder has moved; default: as recorded in DIR")
      ->option_text("FILE")
      ->needs("--deep");
  add_json_option(*command, arguments->json);
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

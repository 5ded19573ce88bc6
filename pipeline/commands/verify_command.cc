#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "pipeline/commands/commands.h"
#include "pipeline/folder/verify_folder.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct VerifyArguments {
  std::string folder;
  bool deep = false;
  std::optional<std::string> manifest;
};

int run(const VerifyArguments& arguments) {
  const FolderCheck check = verify_folder(arguments.folder, {arguments.deep, arguments.manifest});
  for (const std::string& note : check.notes) std::cout << "note: " << note << "\n";
  for (const std::string& fault : check.faults) std::cout << fault << "\n";
  if (arguments.deep) {
    std::cout << "labels of " << check.compared << " samples compared with their sources\n";
  }
  if (!check.faults.empty()) {
    std::cout << check.faults.size() << " faults in " << check.shards << " shards" << std::endl;
    return kFailed;
  }
  std::cout << "sound: " << check.shards << " shards, " << check.samples << " samples, "
            << check.samples - check.valid << " of them quarantined" << std::endl;
  return kComplete;
}

}  // namespace

void add_verify_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("verify",
                         "Checks every file of a folder: hashes, structure, counts, checksums, "
                         "values; exit code 1 and a line for each fault");
  const auto arguments = std::make_shared<VerifyArguments>();
  command->add_option("DIR", arguments->folder, "A folder that convert has written")->required();
  command->add_flag("--deep", arguments->deep,
                    "Compare the labels with the sources, too, where these are there");
  command
      ->add_option("--manifest", arguments->manifest,
                   "With --deep: the job, where its folder has moved; default: as recorded in DIR")
      ->option_text("FILE")
      ->needs("--deep");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

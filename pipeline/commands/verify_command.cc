#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "pipeline/commands/commands.h"
#include "pipeline/errors/exit_codes.h"
#include "pipeline/inspection/verify_folder.h"

namespace eventgan {
namespace {

int run(const std::string& folder) {
  const FolderCheck check = verify_folder(folder);
  for (const std::string& fault : check.faults) std::cout << fault << "\n";
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
  auto* command = app.add_subcommand("verify",
                                     "Checks every shard of a folder: structure, counts, "
                                     "checksums, values; exit code 1 and a line for each fault");
  const auto folder = std::make_shared<std::string>();
  command->add_option("DIR", *folder, "A folder that convert has written")->required();
  command->callback([folder, &exit_code] { exit_code = run(*folder); });
}

}  // namespace eventgan

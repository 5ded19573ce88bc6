#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "pipeline/commands/commands.h"
#include "pipeline/folder/folder_status.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct StatusArguments {
  std::string folder;
  bool json = false;
};

}  // namespace

void add_status_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "status",
      "What stands in an output folder, from its files alone and on any machine: shards done, "
      "running, missing and damaged, quarantined samples, rate, time left");
  const auto arguments = std::make_shared<StatusArguments>();
  command->add_option("DIR", arguments->folder, "A folder that convert writes")->required();
  command->add_flag("--json", arguments->json, "Print JSON");
  command->callback([arguments, &exit_code] {
    const FolderStatus status = folder_status(arguments->folder);
    std::cout << (arguments->json ? status_json(status) : status_text(status)) << std::flush;
    exit_code = kComplete;
  });
}

}  // namespace eventgan

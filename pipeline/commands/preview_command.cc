#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "pipeline/commands/commands.h"
#include "pipeline/commands/standard_streams.h"
#include "pipeline/folder/preview_shard.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct PreviewArguments {
  std::string shard;
  std::string out;
  std::string frames;
  PreviewOptions options;
};

int run(const PreviewArguments& arguments) {
  PreviewOptions options = arguments.options;
  options.out = arguments.out;
  options.frames = arguments.frames;
  std::vector<std::string> warnings;
  for (const auto& picture : preview_shard(arguments.shard, options, warnings)) {
    std::cout << picture.string() << "\n";
  }
  std::cout << std::flush;
  for (const std::string& warning : warnings) tell_warning(warning);
  return kComplete;
}

}  // namespace

void add_preview_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("preview",
                                     "Draws samples of a shard: both frames and the "
                                     "average-timestamp picture, with boxes and joints");
  const auto arguments = std::make_shared<PreviewArguments>();
  command->add_option("SHARD", arguments->shard, "A shard")->required();
  command->add_option("--out", arguments->out, "Folder for the pictures")->required();
  auto* samples =
      command->add_option("--samples", arguments->options.samples, "Slots such as 0,3-5");
  command
      ->add_option("--count", arguments->options.count,
                   "Number of slots, spread over the shard; default: 8")
      ->check(CLI::Range(1, 1 << 20))
      ->excludes(samples);
  command->add_option(
      "--frames", arguments->frames,
      "The manifest's folder, where frame paths start; default: as convert recorded it");
  command->callback([arguments, &exit_code] {
    exit_code = read_guarded(arguments->shard, [&] { return run(*arguments); });
  });
}

}  // namespace eventgan

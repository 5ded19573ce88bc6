#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "manifests/documents/json_text.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/dataset/shown_samples.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/preview/preview.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

struct PreviewArguments {
  std::filesystem::path where;
  PreviewOptions options;
};

int run(const PreviewArguments& arguments) {
  std::vector<std::string> warnings;
  for (const auto& image : preview(arguments.where, arguments.options, warnings)) {
    std::cout << escape_controls(image.string()) << "\n";
  }
  std::cout << std::flush;
  for (const std::string& warning : warnings) tell_warning(warning);
  return kComplete;
}

/// A single shard is compared with its commit record; of many, parts are read.
int run_guarded(const PreviewArguments& arguments) {
  return (means_folder(arguments.where) ? read_apart : read_guarded)(
      arguments.where, [&] { return run(arguments); });
}

}  // namespace

void add_preview_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("preview",
                                     "Draw samples with their labels\nDraws both frames and an "
                                     "image of the average event times, with boxes and joints.");
  const auto arguments = std::make_shared<PreviewArguments>();
  PreviewOptions& options = arguments->options;
  add_shards_argument(*command, arguments->where);
  command->add_option("--out", options.out, "Folder for the images")->required();
  auto* slots =
      command->add_option("--samples", options.slots, "For one shard: slots such as 0,3-5")
          ->option_text("SLOTS");
  auto* ids =
      command
          ->add_option("--sample", options.samples,
                       std::string("Only this sample, ") + kSampleRule + ". Can be repeated")
          ->option_text("SAMPLE")
          ->excludes(slots)
          ->expected(1)
          ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--class", options.class_name, "Only samples with a box of this class")
      ->option_text("NAME")
      ->excludes(slots, ids);
  auto* worst = command
                    ->add_option("--worst", options.worst,
                                 "The N emptiest volumes, the N fullest, and the N whose gaps "
                                 "exceed those of the generator's training the most")
                    ->option_text("N")
                    ->check(CLI::Range(1, 1000))
                    ->excludes(slots, ids);
  command
      ->add_option("--count", options.count,
                   "Number of samples, evenly spread over all; default: 8, or 24 with --sheet")
      ->option_text("N")
      ->check(CLI::Range(1, 10000))
      ->excludes(slots, ids, worst);
  auto* sheet = command->add_flag("--sheet", options.sheet,
                                  "One contact sheet of all samples instead of an image for each");
  command
      ->add_flag("--video", options.video,
                 "An MP4 of the sample's sequence, frames beside events; without --sample, of the "
                 "longest sequence")
      ->excludes(sheet, worst);
  add_frames_option(*command, options.frames);
  command->callback([arguments, &exit_code] { exit_code = run_guarded(*arguments); });
}

}  // namespace eventgan

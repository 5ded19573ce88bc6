#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "manifests/documents/json_text_internal.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/standard_streams.h"
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
  for (const auto& picture : preview(arguments.where, arguments.options, warnings)) {
    std::cout << escape_controls(picture.string()) << "\n";
  }
  std::cout << std::flush;
  for (const std::string& warning : warnings) tell_warning(warning);
  return kComplete;
}

/// A single shard is compared with its marker; of many, parts are read.
int run_guarded(const PreviewArguments& arguments) {
  return (means_folder(arguments.where) ? read_apart : read_guarded)(
      arguments.where, [&] { return run(arguments); });
}

}  // namespace

void add_preview_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "preview",
      "Draws samples: both frames and the average-timestamp picture, with boxes and joints");
  const auto arguments = std::make_shared<PreviewArguments>();
  PreviewOptions& options = arguments->options;
  command
      ->add_option("OUT", arguments->where,
                   "A folder that convert has written, its dataset.h5, or a shard of one")
      ->required();
  command->add_option("--out", options.out, "Folder for the pictures")->required();
  auto* slots = command->add_option("--samples", options.slots, "Of a shard: slots such as 0,3-5")
                    ->option_text("SLOTS");
  auto* ids = command
                  ->add_option("--sample", options.samples,
                               std::string("A sample, ") + kSampleRule + ". May be repeated")
                  ->option_text("SAMPLE")
                  ->excludes(slots)
                  ->expected(1)
                  ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--class", options.class_name, "Only samples with a box of this class")
      ->option_text("NAME")
      ->excludes(slots, ids);
  auto* worst = command
                    ->add_option("--worst", options.worst,
                                 "The N emptiest, the N fullest, and the N whose gap is farthest "
                                 "beyond those that the generator was trained on")
                    ->option_text("N")
                    ->check(CLI::Range(1, 1000))
                    ->excludes(slots, ids);
  command
      ->add_option("--count", options.count,
                   "Number of samples, spread over all; default: 8, with --sheet 24")
      ->option_text("N")
      ->check(CLI::Range(1, 10000))
      ->excludes(slots, ids, worst);
  auto* sheet = command->add_flag("--sheet", options.sheet,
                                  "One picture of all of them, small, instead of one for each");
  command
      ->add_flag("--video", options.video,
                 "An MP4 of the sequence that the sample is of, frames beside events; without a "
                 "sample of the longest one")
      ->excludes(sheet, worst);
  command
      ->add_option(
          "--frames", options.frames,
          "The manifest's folder, where frame paths start; default: as convert recorded it")
      ->option_text("DIR");
  command->callback([arguments, &exit_code] { exit_code = run_guarded(*arguments); });
}

}  // namespace eventgan

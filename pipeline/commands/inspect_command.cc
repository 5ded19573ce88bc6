#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/command_line/options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/dataset/shown_samples.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/runtime/errors.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {
namespace {

struct InspectArguments {
  std::filesystem::path where;
  std::optional<std::string> sample;
  bool json = false;
};

void tell_folder(const InspectArguments& arguments) {
  const DatasetParts parts = read_dataset_parts(folder_of_shards(arguments.where));
  std::cout << (arguments.json ? describe_dataset(parts) : dataset_text(parts));
}

void tell_shard(const InspectArguments& arguments) {
  const ShardReader reader(arguments.where);
  std::cout << (arguments.json ? shard_json : describe_shard)(reader);
}

void tell_sample(const InspectArguments& arguments) {
  const ShownShards shards = find_shown_shards(arguments.where);
  const std::vector<ShownSample> found = find_samples(shards, {*arguments.sample});
  if (found.size() > 1) {
    std::string files;
    for (const ShownSample& sample : found) {
      files += (files.empty() ? "" : ", ") + shards.files[sample.shard].string();
    }
    throw UsageError("--sample: expected the id of one sample, got \"" + *arguments.sample +
                     "\", the id of " + std::to_string(found.size()) + " samples, in " + files +
                     " (name one of these shards)");
  }
  renew_time_limit();
  const ShardReader reader(shards.files[found[0].shard]);
  std::cout << (arguments.json ? sample_json : describe_sample)(reader, found[0].slot);
}

int run(const InspectArguments& arguments) {
  if (arguments.sample) {
    tell_sample(arguments);
  } else if (means_folder(arguments.where)) {
    tell_folder(arguments);
  } else {
    tell_shard(arguments);
  }
  std::cout << std::flush;
  return kComplete;
}

}  // namespace

void add_inspect_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("inspect", "Describe a folder of shards, a shard or a sample");
  const auto arguments = std::make_shared<InspectArguments>();
  add_shards_argument(*command, arguments->where);
  command
      ->add_option("--sample", arguments->sample, std::string("Only this sample, ") + kSampleRule)
      ->option_text("SAMPLE");
  add_json_option(*command, arguments->json);
  command->callback([arguments, &exit_code] {
    exit_code = (means_folder(arguments->where) ? read_apart : read_guarded)(
        arguments->where, [&] { return run(*arguments); });
  });
}

}  // namespace eventgan

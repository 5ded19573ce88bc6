#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/values/faults.h"
#include "pipeline/commands/commands.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/runtime/errors.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {
namespace {

struct InspectArguments {
  std::string shard;
  int sample = -1;
  bool json = false;
};

int run(const InspectArguments& arguments) {
  const ShardReader reader(arguments.shard);
  const int count = reader.header().sample_count;
  if (arguments.sample >= count) {
    throw UsageError("--sample: expected a slot in 0.." + std::to_string(count - 1) + ", got " +
                     std::to_string(arguments.sample));
  }
  if (arguments.sample < 0) {
    std::cout << (arguments.json ? shard_json(reader) : describe_shard(reader));
  } else {
    std::cout << (arguments.json ? sample_json : describe_sample)(reader, arguments.sample);
  }
  std::cout << std::flush;
  return kComplete;
}

}  // namespace

void add_inspect_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("inspect", "Tells what is in a shard, or in one of its samples");
  const auto arguments = std::make_shared<InspectArguments>();
  command->add_option("SHARD", arguments->shard, "A shard")->required();
  command->add_option("--sample", arguments->sample, "A slot, counted from 0")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", arguments->json, "Print JSON");
  command->callback([arguments, &exit_code] {
    exit_code = read_guarded(arguments->shard, [&] { return run(*arguments); });
  });
}

}  // namespace eventgan

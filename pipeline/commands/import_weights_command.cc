#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <utility>

#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
namespace {

/// The published checkpoint's name for the generator.
constexpr char kGenerator[] = "gen";
/// What the authors' training draws gaps from, though it is configured for 6.
constexpr GapRange kAuthorsGaps{1, 5};

struct ImportArguments {
  std::string in;
  std::string out;
};

int run(const ImportArguments& arguments) {
  if (!arguments.out.ends_with(".safetensors")) {
    throw UsageError("expected an output named *.safetensors, got " + arguments.out);
  }
  require_replaceable(arguments.out, OwnFile::kWeights);
  StateDict state = read_checkpoint(arguments.in, kGenerator);
  Weights weights;
  try {
    weights = fold_generator(std::move(state), arguments.in);
  } catch (const std::runtime_error&) {
    std::throw_with_nested(InputError("expected the published generator's network, got another"));
  }
  weights.training_gaps = kAuthorsGaps;
  weights.metadata["origin"] = "PyTorch checkpoint";
  weights.metadata["origin_sha256"] = sha256_of_file(arguments.in);
  const std::string bytes = serialize_weights(weights);
  write_file_atomically(arguments.out, bytes);
  std::cout << arguments.out << ": base width " << weights.base_channels << ", " << weights.bins
            << " bins, " << describe_training_gaps(weights.training_gaps) << ", SHA-256 "
            << sha256_hex(bytes) << std::endl;
  return kComplete;
}

}  // namespace

void add_import_weights_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("import-weights",
                         "Convert the published PyTorch checkpoint\nReads the zip format and the "
                         "one before PyTorch 1.6. Nothing in the checkpoint is executed.");
  const auto arguments = std::make_shared<ImportArguments>();
  command->add_option("IN", arguments->in, "The PyTorch checkpoint")->required();
  command->add_option("OUT", arguments->out, "The weights file to write, *.safetensors")
      ->required();
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>

#include "manifests/documents/job_manifest.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/generators/calibrate.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/stopping.h"
#include "stages/generator/calibration.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
namespace {

struct CalibrateArguments {
  std::string manifest;
  int pairs = kDefaultCalibrationPairs;
  std::optional<std::string> out;
  ProgressStyle progress = ProgressStyle::kAuto;
};

/// What int8 costs, or why that is not known.
std::string error_line(const CalibrationOutcome& outcome) {
  if (!outcome.unmeasured.empty()) return "int8 error: not measured, " + outcome.unmeasured;
  std::vector<double> sorted = outcome.distances;
  if (sorted.empty()) return "int8 error: not measured, the job has no other pairs";
  std::ranges::sort(sorted);
  const double median = (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
  return fmt::format("int8 error against float32, relative L2, on {}: median {:.3f}, worst {:.3f}",
                     count_text(std::ssize(sorted), "other pair"), median, sorted.back());
}

CalibrationOutcome calibrate_job(const CalibrateArguments& arguments, const JobManifest& manifest,
                                 const LoadedWeights& loaded, const StopSignal& signal) {
  CalibrationOptions options;
  options.pairs = arguments.pairs;
  options.stop_requested = [&] { return signal.requested(); };
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total, {"pairs", /*has_bytes=*/false});
  };
  // The plan is used here and then dropped, so its fingerprint needs no engine.
  const PlannedJob job =
      make_plan(manifest, loaded.hash, "none",
                {.stop = options.stop_requested, .show_phase = show_phases(arguments.progress)});
  return calibrate(manifest, job, loaded.weights, options);
}

int run(const CalibrateArguments& arguments) {
  const StopSignal signal(stopping_line("finishing the current pair"));
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  if (!has_weights(manifest.generator.kind)) {
    throw UsageError(
        "$.generator.kind: expected \"network\", the only kind with weights to calibrate, got \"" +
        std::string(to_string(manifest.generator.kind)) + "\"");
  }
  const LoadedWeights loaded = load_weights(manifest);
  const std::filesystem::path file =
      calibrated_file(manifest, loaded.weights.base_channels, arguments.out);
  require_replaceable(file, OwnFile::kWeights);
  if (!loaded.warning.empty()) tell_warning(loaded.warning);

  const CalibrationOutcome outcome = calibrate_job(arguments, manifest, loaded, signal);
  for (const std::string& skipped : outcome.skipped) tell_warning("skipped " + skipped);
  const std::string bytes = serialize_weights(outcome.weights);
  write_file_atomically(file, bytes);
  std::cout << file.string() << ": calibrated on "
            << count_text(outcome.weights.calibration->pairs, "pair") << ", "
            << outcome.skipped.size() << " skipped, SHA-256 " << sha256_hex(bytes) << "\n"
            << error_line(outcome) << "\nFor the manifest:\n  "
            << calibrated_generator_line(manifest, file) << std::endl;
  return kComplete;
}

}  // namespace

void add_calibrate_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "calibrate",
      "Calibrate weights for int8\nMeasures the ranges of the activations on "
      "pairs of the job, measures the int8 error on other pairs, and writes a weights file.");
  const auto arguments = std::make_shared<CalibrateArguments>();
  command
      ->add_option("MANIFEST", arguments->manifest,
                   "The manifest of the job whose generator is calibrated")
      ->required();
  command
      ->add_option("--pairs", arguments->pairs,
                   "Number of pairs to calibrate on, evenly spread over the job; default: 32")
      ->check(CLI::Range(1, 100000));
  command
      ->add_option("--out", arguments->out,
                   "The weights file to write, *.safetensors; default: beside the manifest, named "
                   "after the weights with -calibrated")
      ->option_text("FILE");
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/documents/simulation_manifest.h"
#include "pipeline/command_line/options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/simulation/simulate.h"

namespace eventgan {
namespace {

int run_simulation(const JobOptions& arguments) {
  const SimulationManifest manifest = read_simulation_manifest(arguments.manifest);
  SimulationOptions options;
  options.output = arguments.output;
  options.threads = arguments.threads;
  options.overwrite = arguments.overwrite;
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total, {"frames", /*has_bytes=*/false});
  };
  const SimulationReport report = simulate(manifest, options);
  std::cout << (arguments.as_json() ? to_json(report) : to_text(report)) << std::flush;
  return kComplete;
}

}  // namespace

void add_simulate_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("simulate",
                                     "Simulate event recordings of videos and images\nUses a model "
                                     "of the sensor (manifests/guides/simulation.md).");
  const auto arguments = std::make_shared<JobOptions>();
  add_job_options(*command, *arguments, "MANIFEST",
                  "The manifest of the job (example: manifests/examples/simulate.json)",
                  "Make existing recordings again");
  command->callback([arguments, &exit_code] { exit_code = run_simulation(*arguments); });
}

}  // namespace eventgan

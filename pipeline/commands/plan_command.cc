#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/job_manifest.h"
#include "pipeline/commands/commands.h"
#include "pipeline/conversion/load_generator.h"
#include "pipeline/errors/exit_codes.h"
#include "pipeline/inspection/plan_summary.h"
#include "pipeline/inspection/trial.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/threads/thread_count.h"

namespace eventgan {
namespace {

struct Arguments {
  std::string manifest;
  int threads = 0;
  bool json = false;
};

int run(const Arguments& arguments) {
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  const LoadedGenerator loaded = load_generator(manifest);
  if (!loaded.warning.empty()) std::cerr << "warning: " << loaded.warning << std::endl;
  const PlannedJob job = make_plan(manifest, loaded.weights_hash, loaded.generator->description());
  const int threads = thread_count(arguments.threads);
  const TrialEstimate estimate = measure_trial(manifest, job, *loaded.generator, threads);
  std::cout << (arguments.json ? plan_summary_json : plan_text)(manifest, job.plan, estimate,
                                                                threads)
            << std::flush;
  return kComplete;
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "plan",
      "Tells what convert would do: pairs, what is missing, shards, size and time. Writes nothing");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("MANIFEST", arguments->manifest, "The job")->required();
  command
      ->add_option("--threads", arguments->threads,
                   "Threads the estimate is for; default: all cores")
      ->check(CLI::Range(1, 4096));
  command->add_flag("--json", arguments->json, "Print JSON");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

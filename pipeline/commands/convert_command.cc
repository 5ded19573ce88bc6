#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "manifests/job_manifest.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/job_options.h"
#include "pipeline/commands/progress_option.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/conversion/load_generator.h"
#include "pipeline/errors/exit_codes.h"

namespace eventgan {
namespace {

int run(const JobOptions& arguments) {
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  const LoadedGenerator loaded = load_generator(manifest);
  if (!loaded.warning.empty()) {
    std::cerr << (arguments.as_json() ? warning_json(loaded.warning) : "warning: " + loaded.warning)
              << std::endl;
  }

  ConversionOptions options;
  options.output = arguments.output_folder();
  options.threads = arguments.threads;
  options.overwrite = arguments.overwrite;
  options.make_progress = [&](std::int64_t total) {
    return show_progress(arguments.progress, total);
  };
  const ConversionReport report =
      convert(manifest, *loaded.generator, loaded.weights_hash, options);
  std::cout << (arguments.as_json() ? to_json(report) : to_text(report)) << std::flush;
  if (report.too_many_faults) {
    std::cerr << "error: expected at most " << manifest.errors.max_count
              << " quarantined pairs and " << manifest.errors.max_fraction
              << " of all (errors in the manifest), got " << report.quarantined.size() << " of "
              << report.planned << std::endl;
    return kTooManyFaults;
  }
  return report.complete() ? kComplete : kFailed;
}

}  // namespace

void add_convert_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("convert", "Converts the frame pairs of a manifest into shards");
  const auto arguments = std::make_shared<JobOptions>();
  add_job_options(*command, *arguments, "The job (manifests/examples has some)",
                  "Discard what an earlier run left in the folder");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

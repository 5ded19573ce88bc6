#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <optional>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"
#include "pipeline/commands/commands.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/conversion/load_generator.h"
#include "pipeline/errors/exit_codes.h"

namespace eventgan {
namespace {

struct Arguments {
  std::string manifest;
  std::optional<std::string> output;
  int threads = 0;
  bool overwrite = false;
  ProgressStyle progress = ProgressStyle::kAuto;
};

const std::map<std::string, ProgressStyle> kProgressStyles = {{"auto", ProgressStyle::kAuto},
                                                              {"bar", ProgressStyle::kBar},
                                                              {"lines", ProgressStyle::kLines},
                                                              {"json", ProgressStyle::kJson},
                                                              {"none", ProgressStyle::kNone}};

int run(const Arguments& arguments) {
  const JobManifest manifest = read_job_manifest(arguments.manifest);
  const LoadedGenerator loaded = load_generator(manifest);
  if (!loaded.warning.empty()) {
    std::cerr << (arguments.progress == ProgressStyle::kJson ? warning_json(loaded.warning)
                                                             : "warning: " + loaded.warning)
              << std::endl;
  }

  ConversionOptions options;
  if (arguments.output) {
    // An empty one is a script's unset variable; the manifest's folder is not what was meant.
    if (arguments.output->empty()) throw UsageError("--output: expected a folder, got nothing");
    options.output = *arguments.output;
  }
  options.threads = arguments.threads;
  options.overwrite = arguments.overwrite;
  options.make_progress = [&](std::int64_t total) {
    return std::make_unique<Progress>(std::cerr, arguments.progress, isatty(STDERR_FILENO) != 0,
                                      total);
  };
  const ConversionReport report =
      convert(manifest, *loaded.generator, loaded.weights_hash, options);
  std::cout << (arguments.progress == ProgressStyle::kJson ? to_json(report) : to_text(report))
            << std::flush;
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
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("MANIFEST", arguments->manifest, "The job (manifests/examples has some)")
      ->required();
  command->add_option("--output", arguments->output,
                      "Folder to write to, instead of the manifest's");
  command->add_option("--threads", arguments->threads, "Threads to use; default: all cores")
      ->check(CLI::Range(1, 4096));
  command->add_flag("--overwrite", arguments->overwrite,
                    "Discard what an earlier run left in the folder");
  command
      ->add_option("--progress", arguments->progress,
                   "auto, bar, lines, none; json prints machine-readable lines and report")
      ->transform(CLI::CheckedTransformer(kProgressStyles).description(""))
      ->option_text("STYLE");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace eventgan

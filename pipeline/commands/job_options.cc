#include "pipeline/commands/job_options.h"

#include <CLI/CLI.hpp>

#include "manifests/faults.h"
#include "pipeline/commands/progress_option.h"

namespace eventgan {

std::optional<std::filesystem::path> JobOptions::output_folder() const {
  if (!output) return std::nullopt;
  if (output->empty()) throw UsageError("--output: expected a folder, got nothing");
  return *output;
}

void add_job_options(CLI::App& command, JobOptions& options, const std::string& manifest_text,
                     const std::string& overwrite_text) {
  command.add_option("MANIFEST", options.manifest, manifest_text)->required();
  command.add_option("--output", options.output, "Folder to write to, instead of the manifest's");
  command.add_option("--threads", options.threads, "Threads to use; default: all cores")
      ->check(CLI::Range(1, 4096));
  command.add_flag("--overwrite", options.overwrite, overwrite_text);
  add_progress_option(command, options.progress);
}

}  // namespace eventgan

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <system_error>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "pipeline/command_line/options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/dataset/shown_samples.h"
#include "pipeline/folder/folder_status.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct StatusArguments {
  fs::path where;
  bool json = false;
};

/// The folder that is meant: itself, that of its dataset.h5, or the one that a manifest's job
/// writes to.
fs::path output_folder_of(const fs::path& where) {
  std::error_code unknown;
  if (means_folder(where)) return folder_of_shards(where);
  if (!fs::is_regular_file(where, unknown)) return where;
  const JobManifest manifest = read_job_manifest(where);
  fs::path folder = resolve(manifest, manifest.output.directory).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();  // "out/"
  if (!fs::exists(folder / "plan.json", unknown)) {
    throw InputError("expected a job that eventgan convert has started, got no " +
                     (folder / "plan.json").string() + ", of " + where.string() +
                     " (a trial run is in " + folder.string() +
                     "-trial-N; for a folder given by --output, name that folder)");
  }
  return folder;
}

}  // namespace

void add_status_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("status",
                         "Show the progress of an output folder\nPrints shards done, running, "
                         "missing and damaged, quarantined samples, rate and time left. Reads only "
                         "the files in the folder, so it works on any machine.");
  const auto arguments = std::make_shared<StatusArguments>();
  command
      ->add_option("DIR", arguments->where,
                   "Output folder of convert, or the manifest that names it")
      ->required();
  add_json_option(*command, arguments->json);
  command->callback([arguments, &exit_code] {
    const FolderStatus status = folder_status(output_folder_of(arguments->where));
    std::cout << (arguments->json ? status_json(status) : status_text(status)) << std::flush;
    exit_code = kComplete;
  });
}

}  // namespace eventgan

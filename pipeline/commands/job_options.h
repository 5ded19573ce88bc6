#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/progress/progress.h"

namespace CLI {
class App;
}

namespace eventgan {

/// What every command takes that makes a folder of files by a manifest.
struct JobOptions {
  std::string manifest;
  std::optional<std::string> output;
  int threads = 0;
  bool overwrite = false;
  ProgressStyle progress = ProgressStyle::kAuto;

  bool as_json() const { return progress == ProgressStyle::kJson; }

  /// The folder to write to instead of the manifest's. Throws UsageError if it was given empty: a
  /// script's unset variable, which did not mean the manifest's folder.
  std::optional<std::filesystem::path> output_folder() const;
};

/// Adds MANIFEST, --output, --threads, --overwrite and --progress. `options` must outlive the
/// parsing; the texts are the help of MANIFEST and --overwrite.
void add_job_options(CLI::App& command, JobOptions& options, const std::string& manifest_text,
                     const std::string& overwrite_text);

}  // namespace eventgan

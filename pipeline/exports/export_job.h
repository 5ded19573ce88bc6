#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"
#include "stages/exports/sampled_events.h"

namespace eventgan {

/// What an export is made for; manifests/guides/exports.md says what each consists of.
enum class ExportFormat { kYolo, kCoco, kMpii, kDavis, kWebdataset, kEvents, kDsec, kRvt };

enum class EventFile { kText, kMvsec };

struct ExportOptions {
  ExportFormat to = ExportFormat::kYolo;
  std::filesystem::path out;
  std::vector<std::string> splits;  ///< none: all
  std::optional<std::filesystem::path>
      classes;  ///< kYolo, kCoco, kDsec, kRvt: JSON, class name → number or null
  /// kYolo, kCoco: whether boxes to ignore are kept; unset: kCoco keeps them, kYolo does not.
  std::optional<bool> keep_ignored;
  double full_scale = 1;                       ///< kYolo, kMpii: the value that becomes 255, > 0
  StoredType dtype = StoredType::kFloat16;     ///< kDavis: or kFloat32
  EventCounts counts = EventCounts::kPoisson;  ///< kEvents, kDsec, kRvt
  EventFile event_file = EventFile::kText;     ///< kEvents
  std::uint64_t seed = 0;                      ///< kEvents, kDsec, kRvt
  bool overwrite = false;
  int threads = 0;  ///< 0: all cores; changes no byte
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;  ///< none: silent
  std::function<bool()> stop;  ///< asked now and then; true ends the work. None: never
};

struct ExportReport {
  std::string folder;
  std::int64_t samples = 0;                      ///< exported
  std::int64_t quarantined = 0;                  ///< left out
  std::map<std::string, std::int64_t> left_out;  ///< other things, by what they are and why
  std::vector<std::string> missing;              ///< shards that finalize --partial went without
};

std::string to_text(const ExportReport& report);
std::string to_json(const ExportReport& report);  ///< one line

/// Exports a finalized folder: what is done already stays, the rest is made, DIR/export.json comes
/// last. The same folder and options give the same bytes.
///
/// Throws as ExportInput and ExportFolder do; UsageError if the format has no use for the folder or
/// the class map is wrong; Stopped if `stop` says so, and whole steps stay; std::runtime_error if
/// the disk fails.
ExportReport run_export(const std::filesystem::path& folder, const ExportOptions& options);

}  // namespace eventgan

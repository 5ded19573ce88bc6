#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"
#include "stages/exports/sampled_events.h"

namespace eventgan {

class Exporter;
class ExportInput;
struct ExportOptions;

/// The labels that a source must have for a format to have a use for it.
enum class LabelNeed { kNone, kBoxes, kJoints, kBoxesOrJoints };

/// Records in a text file, one a line, or in a JSON file, the elements of a list.
struct ExportRecords {
  std::string_view list;  ///< of JSON: its name; empty: the file is the list
  /// Separated by blanks, each with its type of schema.org, "t:Float x:Integer", `*` behind it for
  /// a list of them, or BoundingBox: left, top, width, height. The last one of a line may have
  /// blanks, if it is Text.
  std::string_view columns;
};

/// A kind of files.
struct ExportFile {
  /// Below the export's folder. SPLIT, NAME, SET, SHARD, RECORDING and N stand for any text
  /// without a slash, and what is in brackets may be missing.
  std::string_view name;
  std::string_view what;               ///< a line for a person
  std::vector<ExportRecords> records;  ///< what is in it, where that can be said so

  // NOLINTNEXTLINE(google-explicit-constructor): a row may be a name alone
  ExportFile(const char* its_name, std::string_view is = {}, std::vector<ExportRecords> has = {})
      : name(its_name), what(is), records(std::move(has)) {}
};

/// A format of exports, described by the file that makes it; manifests/guides/exports.md says what
/// each consists of.
struct ExportFormat {
  std::string_view word;   ///< of --to
  std::string_view title;  ///< what it writes, in a line
  LabelNeed need = LabelNeed::kNone;
  /// The Hugging Face Hub's word for what its labels are for; empty: as `need` says.
  std::vector<std::string_view> tasks = {};
  std::vector<std::string> options;  ///< those that it takes of the ones that not all formats take
  /// The first that an export has is the one a sample's data is in. Every export has README.md and
  /// croissant.json, too.
  std::vector<ExportFile> files;
  std::unique_ptr<Exporter> (*make)(const ExportInput&, const ExportOptions&) = nullptr;
};

/// All formats, in the order of the page.
const std::vector<ExportFormat>& export_formats();

/// Whether `pattern`, an ExportFile::name, means this name. `split`: what SPLIT means; empty: any.
bool fits(std::string_view name, std::string_view pattern, std::string_view split = {});

/// A pattern with `any` of each SPLIT, NAME ... in it, and `text` of each character besides.
std::string spelled(std::string_view pattern,
                    const std::function<std::string(std::string_view)>& any,
                    const std::function<std::string(char)>& text);

/// Whether a file of the format may have this name, or one of every export.
bool writes(const ExportFormat& format, std::string_view name);

enum class EventFile { kText, kMvsec };

/// An option that not all formats take says nothing to the others.
struct ExportOptions {
  const ExportFormat* to = nullptr;  ///< one of export_formats()
  std::filesystem::path out;
  std::vector<std::string> splits;               ///< none: all
  std::optional<std::filesystem::path> classes;  ///< JSON, class name → number or null
  std::optional<bool>
      keep_ignored;        ///< whether boxes to ignore are kept; unset: as the format does
  double full_scale = 1;   ///< the value that becomes 255, > 0
  bool as_images = false;  ///< volumes as PNG images of three channels
  StoredType dtype = StoredType::kFloat16;  ///< or kFloat32
  /// How many events are drawn of a volume; unset: kPoisson, and of recordings the camera's own.
  std::optional<EventCounts> counts;
  EventFile event_file = EventFile::kText;
  /// Of `rvt` histogram:T, or volume; unset: histogram:10. Of `webdataset` a word of
  /// representations(); unset: the volume as stored.
  std::optional<std::string> representation;
  std::filesystem::path frames;  ///< where frame paths start; empty: as recorded by convert
  double frames_per_second = 1;  ///< of images whose times are not known, 1e-3..1e6
  std::uint64_t seed = 0;
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
  std::vector<std::string> notes;                ///< what a user should know of the files
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

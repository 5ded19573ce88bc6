#include "manifests/files/own_file.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

struct OwnFileRow {
  OwnFile kind;
  std::string_view title;   ///< "expected TITLE, or no file, got another file"
  std::string_view begins;  ///< the file's first bytes
  std::string_view mark;    ///< somewhere behind them
};

constexpr std::string_view kHdf5 = "\x89HDF\r\n\x1a\n";
constexpr std::string_view kPng = "\x89PNG\r\n\x1a\n";

// In the order of OwnFile. Marks are those of all versions: the names of formats, and else what no
// other program writes.
constexpr OwnFileRow kOwnFiles[] = {
    {OwnFile::kPlan, "a frozen plan", "{", "\"eventgan-plan\""},
    {OwnFile::kRunRecord, "eventgan's record of a run", "{", "\"manifest_folder"},
    {OwnFile::kAmendments, "eventgan's amendments", "{", "\"eventgan-amendments\""},
    {OwnFile::kEventIndex, "eventgan's index of events", "eventgan-event-index", ""},
    {OwnFile::kShard, "a shard", kHdf5, "eventgan-shard"},
    {OwnFile::kCommitRecord, "a shard's commit record", "{", "\"eventgan-commit-record\""},
    {OwnFile::kDescription, "eventgan's description of a dataset", "{", "\"eventgan-dataset\""},
    {OwnFile::kView, "eventgan's view of a dataset", kHdf5, "eventgan-view"},
    {OwnFile::kReport, "eventgan's report", "<!DOCTYPE html>", "eventgan report</title>"},
    {OwnFile::kWeights, "a generator's weights", "", "\"eventgan-generator\""},
    {OwnFile::kCheckpoint, "a training's checkpoint", "", "\"eventgan-training\""},
    {OwnFile::kTrainingLock, "a training's lock", "process ", " on "},
    {OwnFile::kTrainingTable, "a training's losses", "phase,step,seconds,", ""},
    {OwnFile::kValidationTable, "a training's validation", "step,volume_loss,", ""},
    {OwnFile::kChart, "eventgan's chart",
     "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\"", ""},
    {OwnFile::kSensor, "a sensor's document", "{", "\"eventgan-sensor\""},
    {OwnFile::kTradeoffReport, "eventgan's trade-off", "{", "\"reference_dtype\""},
    {OwnFile::kTradeoffTable, "eventgan's table of a trade-off", "# ", "on the Pareto front"},
    {OwnFile::kPicture, "eventgan's picture", kPng, "Software\0eventgan"sv},
    {OwnFile::kVideo, "eventgan's video", "", "eventgan preview"},
    {OwnFile::kTrace, "an earlier trace", "{\"traceEvents\":[", ""},
};

/// Whether `mark` stands in the file. Reads block by block, up to where it is found.
bool contains(const InputFile& file, std::string_view mark) {
  constexpr std::size_t kBlock = std::size_t{1} << 20;
  std::string block(kBlock, '\0');
  std::size_t kept = 0;  // the end of the block before, in which a mark may have begun
  for (std::uint64_t offset = 0;;) {
    const std::size_t read = file.read_some(offset, std::span(block).subspan(kept));
    if (read == 0) return false;
    const std::string_view text(block.data(), kept + read);
    if (text.find(mark) != text.npos) return true;
    offset += read;
    kept = std::min(text.size(), mark.size() - 1);
    std::copy(text.end() - static_cast<std::ptrdiff_t>(kept), text.end(), block.begin());
  }
}

}  // namespace

bool is_replaceable(const fs::path& file, OwnFile kind) {
  std::error_code unknown;
  if (!fs::exists(fs::symlink_status(file, unknown))) return true;
  const OwnFileRow& row = kOwnFiles[static_cast<std::size_t>(kind)];
  if (!fs::is_regular_file(file, unknown)) return false;  // a folder is nobody's to replace
  std::string reason;
  const auto found = InputFile::open(file, reason);
  if (!found) throw std::runtime_error("cannot read " + file.string() + ": " + reason);
  if (found->size_bytes() == 0) return true;
  try {
    std::string start(row.begins.size(), '\0');
    return found->read_some(0, start) == start.size() && start == row.begins &&
           (row.mark.empty() || contains(*found, row.mark));
  } catch (const InputError& error) {  // of the disk, and no input here
    throw std::runtime_error(error.what());
  }
}

bool has_own_mark(std::string_view beginning) {
  return std::ranges::any_of(kOwnFiles, [&](const OwnFileRow& row) {
    const std::string_view mark = row.mark.empty() ? row.begins : row.mark;
    return beginning.starts_with(row.begins) && beginning.find(mark) != beginning.npos;
  });
}

bool is_own_output(const fs::path& folder) try {
  std::error_code unknown;
  if (fs::exists(folder / ".export" / "export.txt", unknown)) return true;
  const auto is_own = [](const fs::path& file, OwnFile kind) {
    std::error_code none;
    const auto bytes = fs::file_size(file, none);
    return !none && bytes > 0 && is_replaceable(file, kind);
  };
  if (!is_own(folder / "plan.json", OwnFile::kPlan) &&
      !is_own(folder / "run.json", OwnFile::kRunRecord)) {
    return false;
  }
  // A person's labels or recordings among results are still found: what convert does not replace.
  const auto is_result = [&](const fs::path& file) {
    constexpr std::array<std::string_view, 7> kNames{
        "plan.json",    "manifest.json", "run.json",   "amendments.json",
        "dataset.json", "dataset.h5",    "report.html"};
    const auto beside = [&](const char* extension) {
      return fs::path(file).replace_extension(extension);
    };
    return std::ranges::find(kNames, file.filename()) != kNames.end() ||
           file.extension() == ".index" ||
           ((file.extension() == ".json" || file.extension() == ".h5") &&
            fs::exists(beside(".h5"), unknown) && is_own(beside(".json"), OwnFile::kCommitRecord));
  };
  fs::directory_iterator entry(folder, unknown);
  for (; !unknown && entry != fs::directory_iterator(); entry.increment(unknown)) {
    if (entry->path().filename().string().starts_with('.')) continue;
    std::error_code gone;
    const bool is_folder = entry->is_directory(gone) && !entry->is_symlink(gone);
    if (!(is_folder ? is_own_output(entry->path()) : is_result(entry->path()))) return false;
  }
  return !unknown;
} catch (const std::runtime_error&) {  // nobody may read it
  return false;
}

void require_replaceable(const fs::path& file, OwnFile kind) {
  if (is_replaceable(file, kind)) return;
  throw UsageError("expected " + std::string(kOwnFiles[static_cast<std::size_t>(kind)].title) +
                   ", or no file, got another one, in " + file.string() +
                   " (move it away, or choose another place to write to)");
}

static_assert(std::ranges::is_sorted(kOwnFiles, {}, &OwnFileRow::kind));

}  // namespace eventgan

#include "pipeline/exports/export_folder.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>

#include "manifests/documents/json_text_internal.h"
#include "manifests/values/faults.h"
#include "stages/base/files/atomic_file.h"
#include "stages/base/files/input_file.h"
#include "stages/base/files/unfinished_files.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kReceipts[] = ".export";
constexpr char kIdentity[] = "export.txt";

/// A receipt that parses; else null.
nlohmann::json read_receipt(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  FaultList faults("");
  const auto json = text ? parse_json_text(*text, faults) : std::nullopt;
  const bool is_sound = json && json->is_object() && json->contains("input") &&
                        json->contains("files") && json->at("files").is_object();
  return is_sound ? *json : nlohmann::json();
}

}  // namespace

ExportFolder::ExportFolder(fs::path folder, const std::string& identity, bool overwrite)
    : folder_(std::move(folder)) {
  const fs::path file = folder_ / kReceipts / kIdentity;
  std::string reason;
  auto found = try_read_file(file, reason);
  if (found && *found != identity) {
    if (!overwrite) {
      throw UsageError("expected a new folder, or one of the same export, got that of another, " +
                       folder_.string() + " (--overwrite starts again):\n" + *found +
                       "instead of\n" + identity);
    }
    discard();
    found.reset();
  }
  std::error_code none;
  if (!found && fs::exists(folder_, none)) {
    const bool is_empty =
        fs::is_directory(folder_) &&
        std::all_of(fs::directory_iterator(folder_), {}, [](const fs::directory_entry& entry) {
          return entry.path().filename() == kReceipts;
        });
    if (!is_empty) {
      throw UsageError("expected a new or empty folder, or one of an export, got other files, in " +
                       folder_.string());
    }
  }
  make_folder(folder_);
  make_folder(folder_ / kReceipts);
  if (!found) write_file_atomically(file, identity);
}

fs::path ExportFolder::receipt(const std::string& step) const {
  return folder_ / kReceipts / (step + ".json");
}

void ExportFolder::make_folder(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  if (!made_.insert(folder).second) return;
  fs::create_directories(folder);
  remove_stale_temporaries(folder);
}

void ExportFolder::discard() {
  std::vector<fs::path> receipts;
  for (const auto& entry : fs::directory_iterator(folder_ / kReceipts)) {
    if (entry.path().extension() == ".json") receipts.push_back(entry.path());
  }
  std::set<fs::path> folders;
  for (const fs::path& path : receipts) {
    const nlohmann::json json = read_receipt(path);
    if (!json.is_null()) {
      for (const auto& [relative, size] : json.at("files").items()) {
        fs::remove(folder_ / relative);
        for (fs::path above = fs::path(relative).parent_path(); !above.empty();
             above = above.parent_path()) {
          folders.insert(above);
        }
      }
    }
    fs::remove(path);
  }
  std::error_code not_empty;  // somebody else's file keeps it
  for (auto below = folders.rbegin(); below != folders.rend(); ++below) {
    fs::remove(folder_ / *below, not_empty);
  }
  fs::remove(folder_ / kReceipts / kIdentity);
}

ExportFolder::Step::Step(ExportFolder& folder, std::string name, std::string input)
    : folder_(folder), name_(std::move(name)), input_(std::move(input)) {}

bool ExportFolder::Step::is_done() const {
  const nlohmann::json json = read_receipt(folder_.receipt(name_));
  if (json.is_null() || json.at("input") != input_) return false;
  return std::ranges::all_of(json.at("files").items(), [&](const auto& file) {
    std::error_code missing;
    const auto size = fs::file_size(folder_.folder_ / file.key(), missing);
    return !missing && file.value() == size;
  });
}

void ExportFolder::begin(const std::string& step) {
  const std::lock_guard lock(mutex_);
  if (has_begun_ || step == kExportDescription) return;
  has_begun_ = true;
  if (fs::remove(folder_ / kExportDescription)) sync_to_disk(folder_);
}

fs::path ExportFolder::Step::file(const std::string& relative) {
  folder_.begin(name_);
  const fs::path path = folder_.folder_ / relative;
  folder_.make_folder(path.parent_path());
  const std::lock_guard lock(mutex_);
  files_.push_back(relative);
  return path;
}

void ExportFolder::Step::write(const std::string& relative, std::string_view bytes) {
  write_file_atomically(file(relative), bytes);
}

void ExportFolder::Step::finish() {
  nlohmann::json files = nlohmann::json::object();
  for (const std::string& relative : files_) {
    files[relative] = fs::file_size(folder_.folder_ / relative);
  }
  const fs::path path = folder_.receipt(name_);
  const nlohmann::json earlier = read_receipt(path);
  write_file_atomically(path,
                        dump_json(nlohmann::json{{"input", input_}, {"files", files}}) + "\n");
  if (earlier.is_null()) return;
  for (const auto& [relative, size] : earlier.at("files").items()) {
    if (!files.contains(relative)) fs::remove(folder_.folder_ / relative);
  }
}

}  // namespace eventgan

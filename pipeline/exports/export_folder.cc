#include "pipeline/exports/export_folder.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "pipeline/exports/export_job.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kReceipts[] = ".export";
constexpr char kIdentity[] = "export.txt";
constexpr char kBegun[] = ".begun";

/// Whether an export has files of this name, whichever its format.
bool is_export_name(std::string_view name) {
  const auto is_plain = [](char c) { return c > ' ' && c <= '~'; };
  if (!std::ranges::all_of(name, is_plain) || name.starts_with('.')) return false;
  if (name.find("/.") != name.npos) return false;
  return name == kExportDescription ||
         std::ranges::any_of(export_formats(),
                             [&](const ExportFormat& format) { return writes(format, name); });
}

/// `record`: the file that the name is in, or the folder that it is for.
void require_export_name(const std::string& name, const fs::path& record) {
  if (is_export_name(name)) return;
  throw std::runtime_error("expected the name of a file that an export writes, got " +
                           dump_json(nlohmann::json(name), JsonLayout::kAsciiLine) + ", in " +
                           record.string());
}

/// A receipt that parses; else null. Throws std::runtime_error for a name that is not believed.
nlohmann::json read_receipt(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  FaultList faults("");
  const auto json = text ? parse_json_text(*text, faults) : std::nullopt;
  const bool is_sound = json && json->is_object() && json->contains("input") &&
                        json->contains("files") && json->at("files").is_object();
  if (!is_sound) return {};
  for (const auto& [relative, size] : json->at("files").items()) {
    require_export_name(relative, file);
  }
  return *json;
}

/// The files that a receipt lists; none if it does not parse.
std::set<std::string> files_of(const fs::path& receipt) {
  std::set<std::string> names;
  const nlohmann::json json = read_receipt(receipt);
  if (json.is_null()) return names;
  for (const auto& [relative, size] : json.at("files").items()) names.insert(relative);
  return names;
}

/// The files that a journal names, in quotes and each with a line end before it: one that was
/// broken off is none, and does not spoil the next one. Throws as read_receipt does.
std::set<std::string> read_journal(const fs::path& file) {
  std::string reason;
  std::istringstream lines(try_read_file(file, reason).value_or(""));
  std::set<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    const auto name = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!name.is_string()) continue;
    require_export_name(name, file);
    names.insert(name.get<std::string>());
  }
  return names;
}

bool is_record(const fs::path& path) {
  return path.extension() == ".json" || path.extension() == kBegun;
}

/// The files that a receipt or a journal names.
std::set<std::string> named_by(const fs::path& record) {
  return record.extension() == kBegun ? read_journal(record) : files_of(record);
}

void append_to_journal(const fs::path& file, const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += "\n" + dump_json(nlohmann::json(name));
  std::ofstream journal(file, std::ios::app);
  if (!(journal << text).flush()) {
    throw_system_error("cannot write " + file.string(), errno);
  }
}

/// The line of an identity that says whose shards were exported; empty if it has none.
std::string_view job_of(std::string_view identity) {
  constexpr std::string_view kJob = "\njob ";
  const std::size_t at = identity.find(kJob);
  if (at == identity.npos) return {};
  return identity.substr(at + 1, identity.find('\n', at + 1) - at - 1);
}

}  // namespace

bool ExportFolder::is_of(const fs::path& folder, const std::string& identity) {
  std::string reason;
  return try_read_file(folder / kReceipts / kIdentity, reason) == identity;
}

ExportFolder::ExportFolder(fs::path folder, const std::string& identity, bool overwrite)
    : folder_(std::move(folder)) {
  require_no_link(folder_, kReceipts);
  const fs::path file = folder_ / kReceipts / kIdentity;
  std::string reason;
  const auto found = try_read_file(file, reason);
  const bool is_same = found && *found == identity;
  if (found && !is_same) {
    if (job_of(*found) != job_of(identity)) {
      throw UsageError(
          "expected a new folder or an export of this job, got an export of another job, in " +
          folder_.string() + " (choose another --out, or remove that folder yourself):\n" + *found +
          "instead of\n" + identity);
    }
    if (!overwrite) {
      throw UsageError("expected a new folder or the same export, got another export, in " +
                       folder_.string() + " (--overwrite starts again):\n" + *found +
                       "instead of\n" + identity);
    }
    require_nothing_else();
    remove_other_steps();  // all
  }
  std::error_code none;
  if (!is_same && fs::exists(folder_, none)) {
    const bool is_empty =
        fs::is_directory(folder_) &&
        std::all_of(fs::directory_iterator(folder_), {}, [](const fs::directory_entry& entry) {
          return entry.path().filename() == kReceipts;
        });
    if (!is_empty) {
      throw UsageError("expected a new or empty folder or an export, got other files, in " +
                       folder_.string());
    }
  }
  make_folder(folder_);
  make_folder(folder_ / kReceipts);
  // In place of another export's, which is whose folder it is as long as anything may be left.
  if (!is_same) write_file_atomically(file, identity);
}

fs::path ExportFolder::receipt(const std::string& step) const {
  return folder_ / kReceipts / (step + ".json");
}

fs::path ExportFolder::journal(const std::string& step) const {
  const fs::path file = folder_ / kReceipts / (step + kBegun);
  require_no_link(file.parent_path(), file.filename());  // unlike a receipt it is written in place
  return file;
}

void ExportFolder::for_each_file(const std::function<void(const std::string&)>& take) const {
  std::set<fs::path> receipts;
  for (const auto& entry : fs::directory_iterator(folder_ / kReceipts)) {
    const fs::path& path = entry.path();
    if (path.extension() == ".json" && steps_.contains(path.stem())) receipts.insert(path);
  }
  for (const fs::path& receipt : receipts) {
    for (const std::string& name : files_of(receipt)) take(name);
  }
}

void ExportFolder::make_folder(const fs::path& folder) {
  const std::lock_guard lock(mutex_);
  if (!made_.insert(folder).second) return;
  fs::create_directories(folder);
  remove_stale_temporaries(folder);
}

void ExportFolder::require_nothing_else() const {
  std::set<fs::path> own{kReceipts};
  for (const auto& entry : fs::directory_iterator(folder_ / kReceipts)) {
    if (!is_record(entry.path())) continue;
    for (const std::string& name : named_by(entry.path())) {
      for (fs::path path = name; !path.empty(); path = path.parent_path()) own.insert(path);
    }
  }
  for (const fs::path& path : own) {
    require_no_link(folder_, path.parent_path());
    if (fs::is_directory(fs::symlink_status(folder_ / path))) {
      remove_stale_temporaries(folder_ / path);
    }
  }
  remove_stale_temporaries(folder_);
  for (auto entry = fs::recursive_directory_iterator(folder_); entry != fs::end(entry); ++entry) {
    const fs::path path = entry->path().lexically_relative(folder_);
    if (path == kReceipts) entry.disable_recursion_pending();
    if (own.contains(path)) continue;
    throw UsageError("expected an export and nothing else, which --overwrite removes, got " +
                     path.string() + ", in " + folder_.string() +
                     " (move it away, or choose another --out)");
  }
}

void ExportFolder::remove_other_steps() {
  std::set<fs::path> records, others, files;
  for (const auto& entry : fs::directory_iterator(folder_ / kReceipts)) {
    const fs::path& path = entry.path();
    if (!is_record(path)) continue;
    (steps_.contains(path.stem()) ? others : records).insert(path);
  }
  if (records.empty()) return;
  begin(records.begin()->stem());
  for (const fs::path& record : records) {
    for (const std::string& name : named_by(record)) files.insert(name);
  }
  for (const fs::path& record : others) {
    for (const std::string& name : named_by(record)) files.erase(name);
  }
  std::set<fs::path> folders{""};
  for (const fs::path& relative : files) {
    for (fs::path above = relative; above.has_parent_path();) {
      folders.insert(above = above.parent_path());
    }
  }
  for (const fs::path& below : folders) require_no_link(folder_, below);
  std::error_code kept;  // somebody else's file keeps a folder
  for (const fs::path& relative : files) fs::remove(folder_ / relative, kept);
  for (auto below = folders.rbegin(); below != folders.rend(); ++below) {
    const fs::path folder = folder_ / *below;
    if (!fs::is_directory(folder)) continue;
    remove_stale_temporaries(folder);
    if (!below->empty()) fs::remove(folder, kept);
  }
  for (const fs::path& path : records) fs::remove(path);
}

ExportFolder::Step::Step(ExportFolder& folder, std::string name, std::string input)
    : folder_(folder), name_(std::move(name)), input_(std::move(input)) {
  const std::lock_guard lock(folder_.mutex_);
  folder_.steps_.insert(name_);
}

bool ExportFolder::Step::is_done() const {
  const nlohmann::json json = read_receipt(folder_.receipt(name_));
  const fs::path journal = folder_.journal(name_);
  read_journal(journal);  // names that are not believed, before the step is done again
  if (json.is_null() || json.at("input") != input_ || fs::exists(journal)) return false;
  fs::path folder;  // of the file before
  return std::ranges::all_of(json.at("files").items(), [&](const auto& file) {
    const fs::path relative = file.key();
    if (relative.parent_path() != folder) {
      require_no_link(folder_.folder_, folder = relative.parent_path());
      // Where nothing is written any more, what a killed run has left may have been too new before.
      folder_.make_folder(folder_.folder_ / folder);
    }
    folder_.require_own_name(file.key());
    std::error_code missing;
    const fs::path path = folder_.folder_ / relative;
    if (!fs::is_regular_file(fs::symlink_status(path, missing))) return false;
    const auto size = fs::file_size(path, missing);
    return !missing && file.value() == size;
  });
}

void ExportFolder::begin(const std::string& step) {
  const std::lock_guard lock(mutex_);
  if (has_begun_ || step == kExportDescription) return;
  has_begun_ = true;
  if (fs::remove(folder_ / kExportDescription)) sync_to_disk(folder_);
}

ExportFolder::NameHash ExportFolder::hash_of(const std::string& name) {
  constexpr std::size_t kDigits = 16;
  const std::string hex = sha256_hex(name);
  return {std::stoull(hex.substr(0, kDigits), nullptr, 16),
          std::stoull(hex.substr(kDigits, kDigits), nullptr, 16)};
}

void ExportFolder::require_own_name(const std::string& relative) {
  std::string small = relative;
  std::ranges::transform(small, small.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  const NameHash exact = hash_of(relative);
  const NameHash folded = hash_of(small);
  const std::lock_guard lock(mutex_);
  if (names_.try_emplace(folded, exact).first->second == exact) return;
  throw InputError("expected names of files that differ in more than the case of letters, got " +
                   relative + " beside another, in " + folder_.string() +
                   " (Windows and macOS take both for one: rename the image or sequence)");
}

fs::path ExportFolder::Step::file(const std::string& relative) {
  require_export_name(relative, folder_.folder_);
  folder_.require_own_name(relative);
  require_no_link(folder_.folder_, fs::path(relative).parent_path());
  const fs::path path = folder_.folder_ / relative;
  {
    const std::lock_guard lock(mutex_);
    add_to_journal({relative});
    files_.insert(relative);
  }
  folder_.make_folder(path.parent_path());
  return path;
}

void ExportFolder::Step::add_to_journal(std::set<std::string> names) {
  folder_.begin(name_);
  // What an earlier run has made counts as begun: it may not be made again.
  if (files_.empty()) names.merge(files_of(folder_.receipt(name_)));
  append_to_journal(folder_.journal(name_), names);
}

void ExportFolder::Step::write(const std::string& relative, std::string_view bytes) {
  write_file_atomically(file(relative), bytes);
}

bool ExportFolder::Step::write_unless_edited(const std::string& relative, std::string_view bytes) {
  const nlohmann::json receipt = read_receipt(folder_.receipt(name_));
  const nlohmann::json::json_pointer place = nlohmann::json::json_pointer("/sha256") / relative;
  const fs::path path = file(relative);
  std::string reason;
  const auto there = try_read_file(path, reason);
  // One that was cut is no edit.
  const bool is_edited = there && !bytes.starts_with(*there) && receipt.contains(place) &&
                         receipt.at(place).is_string() && receipt.at(place) != sha256_hex(*there);
  if (!is_edited) write_file_atomically(path, bytes);
  const std::lock_guard lock(mutex_);
  sha256_[relative] = is_edited ? receipt.at(place).get<std::string>() : sha256_hex(bytes);
  return !is_edited;
}

void ExportFolder::Step::finish() {
  if (files_.empty()) add_to_journal({});
  nlohmann::json files = nlohmann::json::object();
  for (const std::string& relative : files_) {
    files[relative] = fs::file_size(folder_.folder_ / relative);
  }
  write_file_atomically(
      folder_.receipt(name_),
      dump_json(nlohmann::json{{"input", input_}, {"files", files}, {"sha256", sha256_}}) + "\n");
  const fs::path journal = folder_.journal(name_);
  for (const std::string& relative : read_journal(journal)) {
    if (files_.contains(relative)) continue;
    require_no_link(folder_.folder_, fs::path(relative).parent_path());
    fs::remove(folder_.folder_ / relative);
  }
  fs::remove(journal);
}

}  // namespace eventgan

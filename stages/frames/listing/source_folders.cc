#include "stages/frames/listing/source_folders.h"

#include <utf8.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <system_error>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"

namespace eventgan {

std::string counted(const std::vector<std::string>& names, const std::string& noun,
                    const std::string& rest) {
  const std::string text = count_text(std::ssize(names), noun, rest);
  return names.empty() ? text : text + ": " + some_of(names, 20);
}

FolderListing list_folder(const std::filesystem::path& folder) {
  FolderListing listing;
  std::error_code error;
  std::filesystem::directory_iterator entries(folder, error);
  if (error == std::errc::no_such_file_or_directory) return listing;
  for (; !error && entries != std::filesystem::directory_iterator(); entries.increment(error)) {
    std::string name = entries->path().filename().string();
    if (name.starts_with("._")) continue;
    if (!utf8::is_valid(name)) {
      listing.passed_over.push_back(escape_controls(name) + " (no UTF-8)");
      continue;
    }
    std::error_code ignored;  // a dangling link is a file that cannot be read later
    const bool is_folder = entries->is_directory(ignored);
    if (is_folder && is_own_output(entries->path())) {
      listing.passed_over.push_back(escape_controls(name) + " (eventgan's output)");
      continue;
    }
    (is_folder ? listing.folders : listing.files).push_back(std::move(name));
  }
  if (error) {
    throw InputError("expected a readable folder, got '" + error.message() + "', in " +
                     folder.string());
  }
  std::ranges::sort(listing.folders);
  std::ranges::sort(listing.files);
  std::ranges::sort(listing.passed_over);
  return listing;
}

bool has_folder(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

bool has_file(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

FolderListing look_into(const std::filesystem::path& folder) {
  try {
    return has_folder(folder) ? list_folder(folder) : FolderListing();
  } catch (const InputError&) {
    return {};
  }
}

std::string in_small_letters(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::filesystem::path folder_named(const std::filesystem::path& above, std::string_view name) {
  if (has_folder(above / name)) return above / name;
  for (const std::string& folder : look_into(above).folders) {
    if (in_small_letters(folder) == in_small_letters(std::string(name))) return above / folder;
  }
  return {};
}

/// A year may follow.
std::string_view split_of(std::string name) {
  static const std::map<std::string_view, std::string_view> kSplits = {
      {"train", "train"}, {"training", "train"}, {"val", "val"},
      {"valid", "val"},   {"validation", "val"}, {"eval", "val"},
      {"dev", "val"},     {"test", "test"},      {"testing", "test"}};
  name.erase(name.find_last_not_of("0123456789") + 1);
  const auto split = kSplits.find(in_small_letters(std::move(name)));
  return split == kSplits.end() ? "" : split->second;
}

SourceRoot::SourceRoot(std::string_view written, const std::filesystem::path& base)
    : written_(written), base_(base) {
  while (written_.size() > 1 && written_.back() == '/') written_.pop_back();
}

std::string SourceRoot::written(std::string_view relative) const {
  if (relative.empty()) return written_;
  std::string path = written_;
  if (!path.empty() && path != "/") path += '/';
  return path.append(relative);
}

std::filesystem::path SourceRoot::on_disk(std::string_view relative) const {
  return base_ / written(relative);
}

SourceRoot SourceRoot::above(std::string_view relative) const {
  const std::filesystem::path path(written(relative));
  const std::filesystem::path name = path.filename();
  const bool is_named = !name.empty() && name != "." && name != "..";
  return {(is_named ? path.parent_path() : path / "..").generic_string(), base_};
}

std::string SourceRoot::name() const {
  const auto path = std::filesystem::absolute(on_disk("")).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();  // "gt/"
}

void SourceRoot::require_folder(std::string_view relative) const {
  std::error_code error;
  const auto status = std::filesystem::status(on_disk(relative), error);
  if (std::filesystem::is_directory(status)) return;
  throw InputError(std::string("expected a folder, got ") +
                   (std::filesystem::exists(status) ? "a file" : "nothing that can be read") +
                   ", in " + written(relative));
}

bool SourceRoot::has_file(std::string_view relative) const {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::symlink_status(on_disk(relative), error).type() == fs::file_type::not_found) return false;
  return !fs::is_directory(fs::status(on_disk(relative), error));
}

std::vector<std::string> SourceRoot::folders_in(std::string_view relative) const {
  return list_folder(on_disk(relative)).folders;
}

std::vector<std::string> SourceRoot::files_in(std::string_view relative) const {
  return list_folder(on_disk(relative)).files;
}

Outcome<std::string> SourceRoot::read(std::string_view relative) const {
  std::string reason;
  if (auto bytes = try_read_file(on_disk(relative), reason)) return *std::move(bytes);
  return SampleFault{"expected a readable file, got '" + reason + "', in " + written(relative)};
}

std::string SourceRoot::read_or_throw(std::string_view relative) const {
  Outcome<std::string> bytes = read(relative);
  if (is_fault(bytes)) throw InputError(bytes.fault().reason);
  return *std::move(bytes);
}

}  // namespace eventgan

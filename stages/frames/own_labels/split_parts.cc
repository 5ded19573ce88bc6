#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/own_labels/find_labels.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> kOrder = {"train", "val", "test"};

/// What a file says of a split: folders and lists, as it writes them.
using SaidSplits = std::vector<std::pair<std::string_view, std::string>>;

/// data.yaml: each key one path or several, below `path`.
SaidSplits said_by_yaml(const fs::path& file, std::string& below) try {
  const YAML::Node document = YAML::Load(beginning_of(file));
  SaidSplits said;
  if (!document.IsMap()) return said;
  for (const auto& entry : document) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    const bool is_one = entry.second.IsScalar();
    if (key == "path" && is_one) below = entry.second.Scalar();
    const std::string_view split = split_of(key);
    if (split.empty()) continue;
    if (is_one) said.emplace_back(split, entry.second.Scalar());
    if (!entry.second.IsSequence()) continue;
    for (const auto& one : entry.second) {
      if (one.IsScalar()) said.emplace_back(split, one.Scalar());
    }
  }
  return said;
} catch (const YAML::Exception&) {  // whoever reads its names says so
  return {};
}

/// Darknet's obj.data: "train = data/train.txt". It knows no test: "valid = data/test.txt" is one.
SaidSplits said_by_data(const fs::path& file) {
  SaidSplits said;
  const std::string text = beginning_of(file);
  for (const TextLine& line : split_lines(text)) {
    const std::size_t mark = line.bytes.find('=');
    if (mark == line.bytes.npos) continue;
    const std::string_view split = split_of(std::string(trimmed(line.bytes.substr(0, mark))));
    if (split.empty()) continue;
    const std::string list(trimmed(line.bytes.substr(mark + 1)));
    const std::string_view of_list = split_of(fs::path(list).stem().string());
    said.emplace_back(of_list.empty() ? split : of_list, list);
  }
  return said;
}

/// Where a path leads that another machine wrote: below one of the folders, or without its first
/// folders. Empty: to nothing here.
fs::path resolved(const std::string& said, const std::vector<fs::path>& folders) {
  std::vector<fs::path> parts;
  for (const fs::path& part : fs::path(said).lexically_normal()) {
    if (!part.empty() && part != "..") parts.push_back(part);
  }
  for (std::size_t first = 0; first < parts.size(); ++first) {
    fs::path rest;
    for (std::size_t i = first; i < parts.size(); ++i) rest /= parts[i];
    for (const fs::path& folder : folders) {
      fs::path found = (folder / rest).lexically_normal();
      if (has_folder(found) || (has_file(found) && lower_extension(found) == ".txt")) return found;
    }
  }
  return {};
}

SaidSplits said_by_names(const fs::path& folder) {
  SaidSplits said;
  for (const fs::path& name : names_with(look_into(folder), ".txt")) {
    constexpr std::string_view kBefore = "autosplit_";
    const std::string stem = name.stem().string();
    if (!stem.starts_with(kBefore)) continue;
    const std::string_view split = split_of(stem.substr(kBefore.size()));
    if (!split.empty()) said.emplace_back(split, name.string());
  }
  return said;
}

}  // namespace

std::vector<SplitPart> split_parts(const fs::path& folder, std::string& file,
                                   std::vector<std::string>& absent) {
  std::vector<fs::path> folders = {folder};
  const auto parts_of = [&](const SaidSplits& said) {
    std::vector<SplitPart> parts;
    for (const std::string_view split : kOrder) {
      for (const auto& [of, path] : said) {
        if (of != split) continue;
        if (fs::path place = resolved(path, folders); !place.empty()) {
          parts.push_back({split, (place / "").parent_path()});
        } else if (lower_extension(path) == ".txt") {
          absent.push_back(path);
        }
      }
    }
    return parts;
  };
  const std::string names = yolo_names_file(folder);
  for (const fs::path& name : {fs::path(names), fs::path("obj.data")}) {
    if (name.empty() || !has_file(folder / name)) continue;
    file = (folder / name).string();
    std::string below;
    const bool is_yaml = lower_extension(name) == ".yaml" || lower_extension(name) == ".yml";
    if (!is_yaml && name != "obj.data") continue;
    absent.clear();
    const SaidSplits said =
        is_yaml ? said_by_yaml(folder / name, below) : said_by_data(folder / name);
    if (!below.empty()) folders.insert(folders.begin(), folder / below);
    if (auto parts = parts_of(said); !parts.empty()) return parts;
  }
  std::vector<SplitPart> parts = parts_of(said_by_names(folder));
  if (!parts.empty()) {
    file = (folder / "autosplit_*.txt").string();
    absent.clear();
  }
  return parts;
}

std::vector<std::string> images_of_list(const fs::path& list) {
  std::string reason;
  const std::string text = try_read_file(list, reason).value_or("");
  std::set<std::string> images;
  for (const TextLine& line : split_lines(text)) {
    if (!trimmed(line.bytes).empty()) images.emplace(trimmed(line.bytes));
  }
  return {images.begin(), images.end()};
}

}  // namespace eventgan

#include "stages/frames/own_labels/detail/find_labels.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/frames/csv_records.h"
#include "stages/frames/own_labels/detail/csv_labels.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "stages/frames/sequences/image_folder.h"
#include "stages/frames/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Names of a folder's files with that extension.
std::vector<fs::path> names_with(const FolderListing& listing, std::string_view extension) {
  std::vector<fs::path> names;
  for (const fs::path name : listing.files) {
    const bool is_hidden = name.string().starts_with('.');
    if (!is_hidden && lower_extension(name) == extension) names.push_back(name);
  }
  return names;
}

/// JSON files and tables, which may label all images below a folder. Each folder is listed once:
/// one is above many places.
class WholeFiles {
 public:
  const std::vector<fs::path>& in(const fs::path& folder, std::string_view extension) {
    const auto [entry, is_new] = listed_.try_emplace(folder);
    const FolderListing listing = is_new ? look_into(folder) : FolderListing();
    for (const std::string_view known : {".json", ".csv"}) {
      for (const fs::path& name : names_with(listing, known)) {
        entry->second[known].push_back(folder / name);
      }
    }
    return entry->second[extension];
  }

 private:
  std::map<fs::path, std::map<std::string_view, std::vector<fs::path>>> listed_;  ///< by extension
};

/// The first bytes of a file, where a format shows.
std::string beginning_of(const fs::path& file) {
  std::string text(1 << 16, '\0');
  std::string reason;
  const auto opened = InputFile::open(file, reason);
  text.resize(opened ? opened->read_some(0, text) : 0);
  return text;
}

/// Images and folders of images, or videos, as a source has them.
struct Frames {
  fs::path root;
  std::vector<std::string> folders;  ///< with images, or with img1 where MOT's labels are
  std::set<std::string> stems;       ///< of the images and videos right in the root
  WholeFiles* files;
};

Frames frames_in(const fs::path& root, WholeFiles& files) {
  Frames frames{root, {}, {}, &files};
  if (has_file(root)) {
    frames.stems.insert(root.stem().string());
    frames.root = root.parent_path();
    return frames;
  }
  if (look_into(root).files.empty() && look_into(root).folders.empty()) return frames;
  const ImageFolder listed = list_image_folder(root);
  for (const auto& [number, name] : listed.frames.frames()) {
    frames.stems.insert(fs::path(name).stem().string());
  }
  for (const fs::path name : listed.left_out) {
    if (is_video_name(name)) frames.stems.insert(name.stem().string());
  }
  if (!frames.stems.empty()) return frames;
  for (const std::string& name : listed.folders) {
    const auto has_frames = [](const fs::path& folder) {
      return !look_into(folder).files.empty() && !list_image_folder(folder).frames.empty();
    };
    if (has_frames(root / name) || has_frames(root / name / "img1")) frames.folders.push_back(name);
  }
  return frames;
}

using Found = std::optional<FoundLabels>;

/// Whether the name that a label file has for an image is one of these frames.
bool is_among(const Frames& frames, const fs::path& name) {
  if (name.is_relative() && has_file(frames.root / name)) return true;
  const fs::path folder = name.parent_path().filename();
  if (frames.stems.contains(folder.string())) return true;  // a video's frame
  const bool may_be_bare = folder.empty() || folder == frames.root.filename();
  if (may_be_bare && has_file(frames.root / name.filename())) return true;
  return folder.empty() && std::ranges::any_of(frames.folders, [&](const std::string& of_it) {
           return has_file(frames.root / of_it / name);
         });
}

/// Whether the beginning of a JSON file is of COCO's labels of these frames, as far as it shows.
bool is_coco_of(const Frames& frames, const fs::path& file) {
  const std::string text = beginning_of(file);
  if (!text.starts_with('{') || file.stem().string().starts_with("captions")) return false;
  const bool has_lists = text.find("\"images\"") != std::string::npos ||
                         text.find("\"annotations\"") != std::string::npos;
  if (!has_lists) return false;
  // instances_train2017.json is of the folder train2017 alone.
  for (const std::string& folder : frames.folders) {
    if (file.stem().string().ends_with(folder)) return false;
  }
  constexpr std::string_view kKey = "\"file_name\"";
  bool any = false;
  for (std::size_t at = text.find(kKey); at != std::string::npos; at = text.find(kKey, at + 1)) {
    const std::size_t begin = text.find('"', at + kKey.size());
    const std::size_t end = begin == std::string::npos ? begin : text.find('"', begin + 1);
    if (end == std::string::npos) break;
    if (is_among(frames, text.substr(begin + 1, end - begin - 1))) return true;
    any = true;
  }
  // A file that begins with other things than images has to be told by its name.
  return !any && file.stem().string().ends_with(frames.root.filename().string());
}

Found find_coco(const Frames& frames, std::vector<std::string>& remarks) {
  std::vector<fs::path> files;
  for (const fs::path& folder :
       {frames.root, frames.root.parent_path(), frames.root / "annotations",
        frames.root.parent_path() / "annotations"}) {
    for (const fs::path& file : frames.files->in(folder, ".json")) {
      if (is_coco_of(frames, file)) files.push_back(file);
    }
  }
  if (files.empty()) return std::nullopt;
  const std::string name = frames.root.filename().string();
  const auto rank = [&](const fs::path& file) {
    const std::string stem = file.stem().string();
    return std::pair(!stem.ends_with(name), !stem.starts_with("instances"));
  };
  std::ranges::stable_sort(files, {}, rank);
  for (std::size_t i = 1; i < files.size(); ++i) {
    remarks.push_back("other COCO labels left out: " + files[i].string());
  }
  return FoundLabels{LabelFormat::kCoco, files.front()};
}

/// The folder of labels that stands for a folder of images; empty if there is none.
fs::path beside(const fs::path& images, const std::vector<std::string_view>& image_folders,
                std::string_view label_folder) {
  std::vector<fs::path> parts(images.begin(), images.end());
  const auto last = std::find_if(parts.rbegin(), parts.rend(), [&](const fs::path& part) {
    return std::ranges::find(image_folders, part.string()) != image_folders.end();
  });
  if (last == parts.rend()) return {};
  *last = label_folder;
  fs::path path;
  for (const fs::path& part : parts) path /= part;
  return has_folder(path) ? path : fs::path();
}

/// Whether a folder has a file of a label, or the folders of it that have images' names.
bool has_labels(const Frames& frames, const fs::path& folder, std::string_view extension) {
  if (folder.empty()) return false;
  const auto has_any = [&](const fs::path& below) {
    return std::ranges::any_of(names_with(look_into(below), extension),
                               [](const fs::path& name) { return name != "classes.txt"; });
  };
  if (!frames.stems.empty()) {
    return std::ranges::any_of(names_with(look_into(folder), extension), [&](const fs::path& name) {
      return frames.stems.contains(name.stem().string());
    });
  }
  return std::ranges::any_of(frames.folders,
                             [&](const std::string& name) { return has_any(folder / name); });
}

Found find_yolo(const Frames& frames, std::vector<std::string>& remarks) {
  for (const fs::path& labels : {beside(frames.root, {"images"}, "labels"), frames.root}) {
    if (!has_labels(frames, labels, ".txt")) continue;
    const bool is_beside = labels == frames.root;  // of texts there, folders above have none
    fs::path folder = labels;
    for (int level = 0; level < (is_beside ? 2 : 3); ++level, folder = folder.parent_path()) {
      for (const char* name : {"data.yaml", "classes.txt"}) {
        if (has_file(folder / name)) {
          return FoundLabels{LabelFormat::kYolo, is_beside ? labels : folder};
        }
      }
    }
    if (!is_beside) {
      remarks.push_back("no data.yaml or classes.txt, so that YOLO's labels are left out: " +
                        labels.string());
    }
  }
  return std::nullopt;
}

Found find_voc(const Frames& frames, std::vector<std::string>&) {
  for (const fs::path& labels : {beside(frames.root, {"JPEGImages", "images"}, "Annotations"),
                                 beside(frames.root, {"images"}, "annotations"), frames.root}) {
    if (has_labels(frames, labels, ".xml")) return FoundLabels{LabelFormat::kVoc, labels};
  }
  return std::nullopt;
}

Found find_mot(const Frames& frames, std::vector<std::string>&) {
  const fs::path above = frames.root.parent_path();
  if (!frames.stems.empty() && has_file(above / "gt/gt.txt") && frames.root.filename() == "img1") {
    return FoundLabels{LabelFormat::kMot, above};
  }
  for (const fs::path& folder : {frames.root, above}) {
    for (const std::string& sequence : frames.folders) {
      for (const char* name : {"gt/gt.txt", "gt.txt"}) {
        if (has_file(folder / sequence / name)) return FoundLabels{LabelFormat::kMot, folder};
      }
    }
  }
  return std::nullopt;
}

Found find_csv(const Frames& frames, std::vector<std::string>& remarks) {
  Found found;
  for (const fs::path& folder : {frames.root, frames.root.parent_path()}) {
    for (const fs::path& file : frames.files->in(folder, ".csv")) {
      const std::string text = beginning_of(file);
      CsvReader reader(text);
      const std::optional<CsvRecord> header = reader.next();
      if (!header) continue;
      const auto place = [&](std::string_view name) {
        return static_cast<std::size_t>(std::ranges::find(header->fields, name) -
                                        header->fields.begin());
      };
      const auto is_absent = [&](std::string_view name) {
        return place(name) == header->fields.size();
      };
      if (std::ranges::any_of(std::array{"image", "class", "left", "top", "right", "bottom"},
                              is_absent)) {
        continue;
      }
      bool any_of_frames = false;
      const std::size_t image = place("image");
      while (const std::optional<CsvRecord> row = any_of_frames ? std::nullopt : reader.next()) {
        any_of_frames = row->fields.size() > image && is_among(frames, row->fields[image]);
      }
      if (!any_of_frames) continue;
      if (!is_label_header(*header)) {
        remarks.push_back("a table with other columns left out: " + file.string());
      } else if (found) {
        remarks.push_back("another table of labels left out: " + file.string());
      } else {
        found = FoundLabels{LabelFormat::kCsv, file};
      }
    }
  }
  return found;
}

/// The first of the formats; the others are remarks.
Found find_any(const Frames& frames, std::vector<std::string>& remarks) {
  Found found;
  for (const auto find : {find_mot, find_coco, find_yolo, find_voc, find_csv}) {
    std::vector<std::string> of_format;
    const Found other = find(frames, of_format);
    remarks.insert(remarks.end(), of_format.begin(), of_format.end());
    if (found && other) {
      remarks.push_back("labels in another format (" + std::string(to_string(other->format)) +
                        ") left out: " + other->path.string());
    }
    if (!found) found = other;
  }
  return found;
}

/// The folders of images that labels may be of, those that are most likely first.
std::vector<fs::path> places_in(const fs::path& root) {
  if (has_file(root)) return {root};
  std::vector<fs::path> places;
  const auto add = [&](const fs::path& place) {
    if (has_folder(place)) places.push_back(place);
  };
  constexpr std::array<std::string_view, 3> kOfImages = {"images", "JPEGImages", "img1"};
  for (const std::string_view name : kOfImages) add(root / name);
  places.push_back(root);
  for (const bool train : {true, false}) {
    for (const std::string& name : look_into(root).folders) {
      if (name.starts_with('.') || name.starts_with("train") != train) continue;
      if (std::ranges::find(kOfImages, name) == kOfImages.end()) add(root / name);
      add(root / name / "images");
    }
  }
  return places;
}

bool is_below(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

/// The split that a folder's name states: "val" of "valid" and of "val2017"; empty if none.
std::string_view split_of(std::string name) {
  name.erase(name.find_last_not_of("0123456789") + 1);
  if (name == "train") return "train";
  if (name == "val" || name == "valid" || name == "validation") return "val";
  return name == "test" ? "test" : "";
}

/// A source for each split that has a folder of images with labels of its own, train first; none
/// unless there are train and another. `found`: all of them in one folder, or train.
std::vector<FoundSource> find_splits(const FoundSource& found, const fs::path& given,
                                     WholeFiles& files, std::vector<fs::path>& with_frames) {
  const std::vector<std::string> folders = frames_in(found.root, files).folders;
  const bool has_all =
      !folders.empty() &&
      std::ranges::none_of(folders, [](const std::string& name) { return split_of(name).empty(); });
  const fs::path way = found.root.lexically_relative(given);  // "train/images"
  if (!has_all && split_of(way.begin()->string()) != "train") return {};
  const fs::path above = has_all ? found.root : given;
  std::map<std::ptrdiff_t, FoundSource> splits;  // by their place in kOrder
  constexpr std::array<std::string_view, 3> kOrder = {"train", "val", "test"};
  for (const std::string& name : look_into(above).folders) {
    const auto place = std::ranges::find(kOrder, split_of(name));
    if (place == kOrder.end()) continue;
    fs::path root = above / name;
    for (auto part = has_all ? way.end() : std::next(way.begin()); part != way.end(); ++part) {
      root /= *part;
    }
    if (!has_folder(root)) continue;
    const Frames frames = frames_in(root, files);
    if (has_all) with_frames.push_back(root);
    FoundSource source = found;
    source.root = root;
    source.remarks.clear();
    source.labels = find_any(frames, source.remarks);
    source.split = place == kOrder.begin() ? "" : *place;
    if (source.labels) splits.emplace(place - kOrder.begin(), std::move(source));
  }
  if (splits.size() < 2 || !splits.contains(0)) return {};
  std::vector<FoundSource> sources;
  for (auto& [place, source] : splits) sources.push_back(std::move(source));
  std::set<fs::path>
      files_of_all;  // where one file has labels of several splits, these are one source
  for (const FoundSource& source : sources) {
    const bool is_file = has_file(source.labels->path);
    if (is_file && !files_of_all.insert(source.labels->path).second) return {};
  }
  const bool has_found = has_all || sources.front().root == found.root;
  return has_found ? sources : std::vector<FoundSource>();
}

/// Tells of images that are no part of the sources that were chosen, or that are in one split with
/// the first.
void note_other_images(const std::vector<fs::path>& with_frames, const fs::path& given,
                       WholeFiles& files, std::vector<FoundSource>& sources) {
  std::vector<std::string> left_out;
  fs::path last;
  for (const fs::path& place : with_frames) {
    const bool is_of_source = std::ranges::any_of(sources, [&](const FoundSource& source) {
      return is_below(place, source.root) || is_below(source.root, place);
    });
    if (is_of_source) continue;
    if (!last.empty() && is_below(place, last)) continue;  // told with the folder that it is in
    last = place;
    left_out.push_back(place.lexically_relative(given).generic_string());
  }
  FoundSource& found = sources.front();
  if (!left_out.empty()) {
    found.remarks.push_back("warning: " + counted(left_out, "folders of images left out"));
  }
  const std::vector<std::string> folders = frames_in(found.root, files).folders;
  if (std::ranges::find(folders, "train") == folders.end()) return;
  for (const std::string& name : folders) {
    if (name != "val" && name != "valid" && name != "test") continue;
    found.remarks.push_back("warning: images of " + name +
                            " are in split train, too: give each its own source with \"split\"");
  }
}

}  // namespace

std::vector<FoundSource> find_own_labels(FoundSource found) {
  std::vector<std::string> remarks;                   // of the first place, where none has labels
  std::vector<std::pair<fs::path, fs::path>> others;  // other places with labels, and these
  std::optional<fs::path> root;
  std::optional<fs::path> first_place;  // with frames, where the root itself has none
  std::vector<fs::path> with_frames;
  const fs::path given = found.root;
  WholeFiles files;
  const Frames whole = frames_in(given, files);
  const bool is_empty = whole.stems.empty() && whole.folders.empty();
  for (const fs::path& place : places_in(found.root)) {
    const Frames frames = frames_in(place, files);
    if (frames.stems.empty() && frames.folders.empty()) continue;
    with_frames.push_back(place);
    if (is_empty && !first_place) first_place = place;
    std::vector<std::string> of_place;
    const Found labels = find_any(frames, of_place);
    if (labels && !found.labels) {
      found.labels = labels;
      root = place;
      remarks = std::move(of_place);
    } else if (labels && labels->path != found.labels->path) {
      others.emplace_back(place, labels->path);
    } else if (!found.labels && remarks.empty()) {
      remarks = std::move(of_place);
    }
  }
  if (root || first_place) found.root = root ? *root : *first_place;
  found.remarks.insert(found.remarks.end(), remarks.begin(), remarks.end());
  std::vector<FoundSource> sources;
  if (found.labels) sources = find_splits(found, given, files, with_frames);
  if (sources.empty()) sources.push_back(std::move(found));
  for (const auto& [place, labels] : others) {
    if (std::ranges::find(sources, place, &FoundSource::root) != sources.end()) continue;
    sources.front().remarks.push_back("labels of other images left out: " + labels.string() +
                                      " of " + place.string());
  }
  note_other_images(with_frames, given, files, sources);
  return sources;
}

}  // namespace eventgan

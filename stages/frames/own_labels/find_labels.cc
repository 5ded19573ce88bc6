#include "stages/frames/own_labels/find_labels.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/text.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {
namespace fs = std::filesystem;

namespace {

FoundFrames frames_in(const fs::path& root, WholeFiles& files) {
  FoundFrames frames{.root = root, .files = &files};
  if (has_file(root)) {
    frames.stems.insert(root.stem().string());
    frames.is_video = true;
    frames.root = root.parent_path();
    return frames;
  }
  const FolderListing seen = look_into(root);
  if (seen.files.empty() && seen.folders.empty()) return frames;
  ImageFolder listed = list_image_folder(root);
  for (const auto& [number, name] : listed.frames.frames()) {
    frames.stems.insert(fs::path(name).stem().string());
  }
  if (!frames.stems.empty()) return frames;
  for (const fs::path name : listed.left_out) {
    if (is_video_name(name)) frames.stems.insert(name.stem().string());
  }
  frames.is_video = !frames.stems.empty();
  if (frames.is_video) return frames;
  const auto has_frames = [](const fs::path& folder) {
    return !look_into(folder).files.empty() && !list_image_folder(folder).frames.empty();
  };
  drop_label_folders(root, listed.folders);
  for (const std::string& name : listed.folders) {
    if (has_frames(root / name) || has_frames(root / name / "img1")) {
      frames.folders.push_back(name);
      continue;
    }
    if (is_image_folder(name)) continue;
    std::vector<std::string> two_deep = look_into(root / name).folders;
    drop_label_folders(root / name, two_deep);
    for (const std::string& below : two_deep) {
      if (is_image_folder(below) || !has_frames(root / name / below)) continue;
      frames.folders.push_back(name + "/" + below);
    }
  }
  return frames;
}

/// Whether YOLO's texts in a folder have numbers alone for classes.
bool has_no_names(const fs::path& labels) {
  return yolo_names_file(labels).empty() && yolo_names_file(labels.parent_path()).empty();
}

/// Whether each of YOLO's texts in a folder has a file of VOC's, with the names.
bool covers(const FoundLabels& voc, const fs::path& texts) {
  const auto stems = [](const fs::path& folder, std::string_view extension) {
    std::set<std::string> names;
    for (const fs::path name : look_into(folder).files) {
      if (lower_extension(name) == extension) names.insert(name.stem().string());
    }
    return names;
  };
  if (voc.format != LabelFormat::kVoc) return false;
  const std::set<std::string> wanted = stems(texts, ".txt");
  return !wanted.empty() && std::ranges::includes(stems(voc.path, ".xml"), wanted);
}

/// Gives a source the first of the formats, but VOC's names before YOLO's numbers; masks beside
/// boxes are their outlines, the others are remarks.
void find_any(const FoundFrames& frames, FoundSource& source) {
  std::optional<FoundLabels>& found = source.labels;
  found.reset();
  source.unread.clear();
  std::vector<std::string>& remarks = source.remarks;
  for (const LabelReader* const reader : kLabelReaders) {
    LabelSearch search = reader->find(frames);
    std::ranges::move(search.remarks, std::back_inserter(remarks));
    if (search.paths.empty()) continue;
    if (!found) {
      found = FoundLabels{reader->format, search.paths.front()};
      found->more.assign(search.paths.begin() + 1, search.paths.end());
      source.unread = std::move(search.unread);
    } else if (reader->format == LabelFormat::kMasks) {
      found->outlines = search.paths.front();
    } else {
      FoundLabels other{reader->format, search.paths.front()};
      const bool lacks_names = found->format == LabelFormat::kYolo && has_no_names(found->path);
      const bool is_better = lacks_names && covers(other, found->path);
      if (is_better) std::swap(*found, other);
      remarks.push_back("labels in another format (" + std::string(to_string(other.format)) +
                        ") left out: " + other.path.string() +
                        (lacks_names && !is_better ? ", which has the names of the classes" : ""));
    }
  }
}

/// The folders of images that labels may be of, those that are most likely first.
std::vector<fs::path> places_in(const fs::path& root) {
  if (has_file(root)) return {root};
  std::vector<fs::path> places;
  const auto add = [&](const fs::path& place) {
    if (has_folder(place)) places.push_back(place);
  };
  const auto folders_of = [](const fs::path& folder, bool train) {
    std::vector<std::string> names = look_into(folder).folders;
    drop_label_folders(folder, names);
    std::erase_if(names, [&](const std::string& name) {
      const bool is_train = name.starts_with("train") || split_of(name) == "train";
      return name.starts_with('.') || is_train != train;
    });
    return names;
  };
  std::vector<fs::path> of_images;
  for (const std::string_view name : kImageFolders) {
    if (fs::path folder = folder_named(root, name); !folder.empty()) of_images.push_back(folder);
  }
  for (const fs::path& folder : of_images) add(folder);
  add(root);
  for (const bool train : {true, false}) {
    for (const fs::path& folder : of_images) {  // images/train2017, with labels apart
      for (const std::string& name : folders_of(folder, train)) add(folder / name);
    }
    for (const std::string& name : folders_of(root, train)) {
      if (!is_image_folder(name)) add(root / name);
      add(folder_named(root / name, "images"));
    }
  }
  return places;
}

bool is_below(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

/// Whether a folder's images are of a source: those below its root, unless some lie right in it.
bool is_in(const fs::path& place, const fs::path& root, const std::set<fs::path>& with_images) {
  return place == root || (is_below(place, root) && !with_images.contains(root));
}

/// A source for each split that has a folder of images with labels of its own, train first; none
/// unless there are two. `found`: all of them in one folder, or one of them, whose own split is set
/// where its folder below `given` states it.
std::vector<FoundSource> find_splits(FoundSource& found, const fs::path& given, WholeFiles& files,
                                     std::vector<fs::path>& with_frames) {
  const std::vector<std::string> folders = frames_in(found.root, files).folders;
  const bool has_all =
      !folders.empty() &&
      std::ranges::none_of(folders, [](const std::string& name) { return split_of(name).empty(); });
  const fs::path way = found.root.lexically_relative(given);  // "train/images", "images/train2017"
  const auto of_split = std::find_if(way.begin(), way.end(), [](const fs::path& part) {
    return !split_of(part.string()).empty();
  });
  if (!has_all && of_split == way.end()) return {};
  fs::path above = has_all ? found.root : given;
  for (auto part = way.begin(); !has_all && part != of_split; ++part) above /= *part;
  std::map<std::ptrdiff_t, FoundSource> splits;  // by their place in kOrder
  constexpr std::array<std::string_view, 3> kOrder = {"train", "val", "test"};
  for (const std::string& name : look_into(above).folders) {
    const auto place = std::ranges::find(kOrder, split_of(name));
    if (place == kOrder.end()) continue;
    fs::path root = above / name;
    for (auto part = has_all ? way.end() : std::next(of_split); part != way.end(); ++part) {
      root /= *part;
    }
    if (!has_folder(root)) continue;
    const FoundFrames frames = frames_in(root, files);
    if (has_all) with_frames.push_back(root);
    FoundSource source = found;
    source.root = root;
    source.remarks.clear();
    find_any(frames, source);
    source.split = place == kOrder.begin() ? "" : *place;
    if (source.labels) splits.emplace(place - kOrder.begin(), std::move(source));
  }
  std::vector<FoundSource> sources;
  for (auto& [place, source] : splits) sources.push_back(std::move(source));
  std::set<fs::path> files_of_all;  // one file with labels of several splits makes one source
  for (const FoundSource& source : sources) {
    const bool is_file = has_file(source.labels->path);
    if (is_file && !files_of_all.insert(source.labels->path).second) return {};
  }
  const bool has_found =
      has_all || std::ranges::find(sources, found.root, &FoundSource::root) != sources.end();
  if (!has_found) return {};
  if (sources.size() == 1 && !has_all) found.split = sources.front().split;
  return sources.size() < 2 ? std::vector<FoundSource>() : sources;
}

/// Tells of images that are in two of the sources or, of lists, in none.
void note_overlaps(const FoundFrames& frames, const std::string& file,
                   std::vector<FoundSource>& sources) {
  std::vector<std::string>& remarks = sources.front().remarks;
  const auto word = [](const FoundSource& source) {
    return source.split.empty() ? "train" : std::string(source.split);
  };
  const std::vector<std::string>& images = image_names_of(frames);
  const std::set<std::string> known(images.begin(), images.end());
  std::map<std::string, std::string_view> listed;  // the splits of these
  bool has_lists = false;
  std::size_t twice = 0;
  for (const FoundSource& source : sources) {
    for (const FoundSource& other : sources) {
      if (source.split == other.split || !is_below(other.root, source.root)) continue;
      if (source.root == other.root || !frames_in(source.root, *frames.files).stems.empty())
        continue;
      remarks.push_back("warning: images of " + word(other) + " are in split " + word(source) +
                        ", too, as " + file + " says");
    }
    if (!source.ids) continue;
    has_lists = true;
    for (std::string line : images_of_list(*source.ids)) {
      std::ranges::replace(line, '\\', '/');
      std::string image = fs::path(line).lexically_normal().generic_string();
      while (!known.contains(image) && image.find('/') != image.npos) {
        image.erase(0, image.find('/') + 1);  // as the selection of samples does
      }
      if (!known.contains(image)) continue;
      const auto [entry, is_new] = listed.emplace(image, source.split);
      twice += !is_new && entry->second != source.split;
    }
  }
  if (twice > 0) {
    remarks.push_back("warning: " + count_text(static_cast<std::int64_t>(twice), "image") +
                      " in lists of two splits, as " + file + " says");
  }
  if (!has_lists) return;
  const auto in_none = std::ssize(known) - std::ssize(listed);
  if (in_none > 0) {
    remarks.push_back("warning: " +
                      count_text(in_none, "image", " left out: in no list of " + file));
  }
}

/// A source for each folder or list that data.yaml, obj.data or autosplit_*.txt gives a split; none
/// if they say no more than that all is train.
std::vector<FoundSource> find_said_splits(FoundSource& found, const fs::path& given,
                                          WholeFiles& files) {
  std::vector<fs::path> folders = {found.labels->path, given};
  if (is_image_folder(given.filename().string())) folders.push_back(given.parent_path());
  folders.push_back(given / "data");
  std::set<fs::path> known;
  for (const fs::path& folder : folders) {
    if (!known.insert(folder).second) continue;
    std::string file;
    std::vector<FoundSource> sources;
    std::vector<std::string> remarks, absent;
    const std::vector<SplitPart> parts = split_parts(folder, file, absent);
    if (!absent.empty()) {
      remarks.push_back("warning: " + counted(absent, "list", " of " + file + " not there"));
    }
    for (const auto& [split, place] : parts) {
      FoundSource source = found;
      if (!sources.empty() || has_folder(place)) source.remarks.clear();
      if (!sources.empty()) source.unread.clear();
      source.split = split == "train" ? "" : split;
      if (has_file(place)) {
        source.ids = place;
      } else {
        const FoundFrames frames = frames_in(place, files);
        const bool has_frames = !frames.stems.empty() || !frames.folders.empty();
        if (!has_frames || !is_below(place, given)) continue;
        source.root = place;
        find_any(frames, source);
        if (!source.labels) continue;
      }
      const auto same = std::ranges::find_if(sources, [&](const FoundSource& other) {
        return other.root == source.root && other.ids == source.ids;
      });
      if (same == sources.end()) {
        sources.push_back(std::move(source));
      } else if (same->split != source.split) {
        remarks.push_back("warning: " + file + " gives " + place.string() +
                          " two splits: it is in one, " +
                          (same->split.empty() ? "train" : std::string(same->split)));
      }
    }
    const bool is_given = sources.size() == 1 && sources[0].root == given && !sources[0].ids;
    if (is_given || std::ranges::all_of(
                        sources, [](const FoundSource& source) { return source.split.empty(); })) {
      std::ranges::move(remarks, std::back_inserter(found.remarks));
      continue;
    }
    std::ranges::move(remarks, std::back_inserter(sources.front().remarks));
    note_overlaps(frames_in(found.root, files), file, sources);
    return sources;
  }
  return {};
}

/// Which split a file's name tells: "train" of train_labels.csv, "val" of instances_val2017.json.
std::string_view split_in(const fs::path& file) {
  const std::string stem = file.stem().string();
  for (std::size_t begin = 0; begin < stem.size();) {
    const std::size_t end = std::min(stem.find_first_of("_-. ", begin), stem.size());
    const std::string_view split = split_of(stem.substr(begin, end - begin));
    if (!split.empty()) return split;
    begin = end + 1;
  }
  return {};
}

/// Gives each file with labels of other images of a source's folder a source of its own, with the
/// split that its name tells. Where lists say which images are of a split, the files are unread.
void add_other_files(std::vector<FoundSource>& sources) {
  std::vector<FoundSource> all;
  for (FoundSource& source : sources) {
    const std::vector<fs::path> more =
        source.labels ? std::exchange(source.labels->more, {}) : std::vector<fs::path>();
    FoundSource& first = all.emplace_back(source);
    if (source.ids) {
      for (const fs::path& file : more) {
        if (&source != &sources.front()) break;  // told once
        first.unread.push_back(file.string() + " is not read beside " +
                               source.labels->path.filename().string() +
                               ", since lists divide the images: join them in one file");
      }
      continue;
    }
    const auto take = [&](FoundSource& of_file, const fs::path& file) {
      of_file.labels->path = file;
      const std::string_view split = split_in(file);
      if (source.split.empty() && split != "train") of_file.split = split;
    };
    if (more.empty()) continue;
    const auto begin = std::ssize(all) - 1;
    take(first, source.labels->path);
    for (const fs::path& file : more) {
      take(all.emplace_back(source), file);
    }
    const auto order = [](const FoundSource& of_file) {
      constexpr std::array<std::string_view, 3> kOrder = {"", "val", "test"};
      return std::ranges::find(kOrder, of_file.split) - kOrder.begin();
    };
    std::ranges::stable_sort(all.begin() + begin, all.end(), {}, order);
    for (auto other = all.begin() + begin + 1; other != all.end(); ++other) {
      other->remarks.clear();
      other->unread.clear();
    }
  }
  sources = std::move(all);
}

/// Tells of images that are no part of the sources that were chosen, or that are in one split with
/// the first.
void note_other_images(const std::vector<fs::path>& with_frames,
                       const std::set<fs::path>& with_images, const fs::path& given,
                       WholeFiles& files, std::vector<FoundSource>& sources) {
  std::vector<std::string> left_out;
  fs::path last;
  for (const fs::path& place : with_frames) {
    const bool is_of_source = std::ranges::any_of(sources, [&](const FoundSource& source) {
      const bool are_masks =
          source.labels && (source.labels->path == place || source.labels->outlines == place);
      return are_masks || is_in(place, source.root, with_images) || is_below(source.root, place);
    });
    if (is_of_source) continue;
    if (!last.empty() && is_below(place, last)) continue;  // told with the folder that it is in
    last = place;
    left_out.push_back(place.lexically_relative(given).generic_string());
  }
  FoundSource& found = sources.front();
  if (!left_out.empty()) {
    found.remarks.push_back("warning: " + counted(left_out, "folder", " of images left out"));
  }
  if (found.ids) return;  // a list says which
  const std::vector<std::string> folders = frames_in(found.root, files).folders;
  const auto is_train = [](const std::string& name) { return split_of(name) == "train"; };
  if (std::ranges::none_of(folders, is_train)) return;
  for (const std::string& name : folders) {
    const std::string_view split = split_of(name);
    if (split.empty() || split == "train") continue;
    found.remarks.push_back("warning: images of " + name +
                            " are in split train, too: give each its own source with \"split\"");
  }
}

/// Tells of lists that divide the images of the only source.
void note_lists(const fs::path& given, const FoundFrames& frames, FoundSource& source) {
  for (const fs::path& folder : {given, given / "ImageSets/Main"}) {
    std::vector<std::string> lists;
    for (const fs::path& name : names_with(look_into(folder), ".txt")) {
      const std::string stem = name.stem().string();
      const bool is_list = !split_of(stem).empty() && !frames.stems.contains(stem);
      if (is_list) lists.push_back(name.string());
    }
    if (lists.empty()) continue;
    source.remarks.push_back(
        "warning: " + counted(lists, "list", " of a split not used in " + folder.string()) +
        "; give each split its own source with \"ids\", a sample id a line");
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
  std::vector<FoundFrames> places;
  const FoundFrames whole = frames_in(given, files);
  const bool is_empty = whole.stems.empty() && whole.folders.empty();
  for (const fs::path& place : places_in(found.root)) {
    const FoundFrames& frames = places.emplace_back(frames_in(place, files));
    if (frames.stems.empty() && frames.folders.empty()) {
      places.pop_back();
      continue;
    }
    with_frames.push_back(place);
    if (is_empty && !first_place) first_place = place;
    FoundSource of_place;
    find_any(frames, of_place);
    const auto& labels = of_place.labels;
    if (labels && !found.labels) {
      found.labels = labels;
      found.unread = std::move(of_place.unread);
      root = place;
      remarks = std::move(of_place.remarks);
    } else if (labels && labels->path != found.labels->path) {
      others.emplace_back(place, labels->path);
    } else if (!found.labels && remarks.empty()) {
      remarks = std::move(of_place.remarks);
    }
  }
  if (root || first_place) found.root = root ? *root : *first_place;
  found.remarks.insert(found.remarks.end(), remarks.begin(), remarks.end());
  std::vector<FoundSource> sources;
  if (found.labels) sources = find_said_splits(found, given, files);
  if (found.labels && sources.empty()) sources = find_splits(found, given, files, with_frames);
  if (sources.empty()) sources.push_back(std::move(found));
  add_other_files(sources);
  std::set<fs::path> with_images;  // right in them
  for (const FoundFrames& frames : places) {
    if (!frames.stems.empty()) with_images.insert(frames.root);
  }
  for (const auto& other : others) {
    const auto& [place, labels] = other;
    const bool is_of_source = std::ranges::any_of(sources, [&](const FoundSource& source) {
      return is_in(other.first, source.root, with_images) ||
             is_in(source.root, other.first, with_images);
    });
    if (is_of_source) continue;
    sources.front().remarks.push_back("labels of other images left out: " + labels.string() +
                                      " of " + place.string());
  }
  note_other_images(with_frames, with_images, given, files, sources);
  UnreadLabels unread = unread_labels(places, given, sources);
  std::ranges::move(unread.lines, std::back_inserter(sources.front().unread));
  std::vector<std::string>& remarks_of_all = sources.front().remarks;
  if (!unread.others.empty()) {
    constexpr std::string_view kRest = " with names of these images not read";
    remarks_of_all.push_back(unread.are_more
                                 ? std::to_string(unread.others.size()) + " or more files" +
                                       std::string(kRest) + ": " + some_of(unread.others, 20)
                                 : counted(unread.others, "file", std::string(kRest)));
  }
  if (!unread.limit.empty()) remarks_of_all.push_back(std::move(unread.limit));
  if (sources.size() == 1) note_lists(given, whole, sources.front());
  return sources;
}

}  // namespace eventgan

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/own_labels/detail/label_file.h"
#include "stages/frames/own_labels/find_labels.h"
#include "stages/frames/own_labels/label_readers.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

bool is_image_or_video(const fs::path& name) {
  return is_video_name(name) ||
         std::ranges::find(kImageExtensions, lower_extension(name)) != kImageExtensions.end();
}

constexpr std::array<std::string_view, 11> kExtensions{
    ".txt", ".json", ".jsonl", ".ndjson", ".odgt", ".xml", ".csv", ".tsv", ".mat", ".npy", ".npz"};

bool starts_with_any(const std::string& name, std::initializer_list<std::string_view> starts) {
  const std::string small = in_small_letters(name);
  return std::ranges::any_of(starts,
                             [&](std::string_view start) { return small.starts_with(start); });
}

bool may_have_images(const std::string& folder) {
  return starts_with_any(folder, {"image", "img", "jpegimages"});
}

/// Columns that say nothing of what an image shows.
bool is_of_files(std::string_view header) {
  static const std::set<std::string> kFileColumns{
      "image", "image_id", "filename", "file_name", "file",   "name",  "path",      "id",
      "width", "height",   "channels", "mode",      "size",   "bytes", "sequence",  "clip",
      "video", "index",    "frame",    "frame_id",  "number", "time",  "timestamp", "date",
      "fps",   "url",      "license",  "md5",       "sha256", "split", "set",       "camera"};
  const std::string text = in_small_letters(std::string(header));
  CsvReader reader(text, separator_of(text));
  const auto row = reader.next();
  return row && row->fields.size() > 1 &&
         std::ranges::all_of(row->fields, [](std::string_view field) {
           return kFileColumns.contains(std::string(trimmed(field)));
         });
}

/// Of single images, or of others, so many are looked at in a folder.
constexpr std::size_t kMostOfImages = 3;
constexpr std::size_t kMostOthers = 50;
constexpr std::size_t kMostFiles = 1000, kMostFolders = 1000;
constexpr std::size_t kMostLines = 5;
constexpr int kDepth = 4;  // ROOT/images/train/a/b

class UnreadFinder {
 public:
  UnreadFinder(const std::vector<FoundFrames>& places, const std::vector<FoundSource>& sources)
      : files_(*places.front().files), images_(places), sources_(sources) {
    for (const FoundSource& source : sources) {
      if (!source.labels) continue;
      has_labels_ = true;
      own_extensions_.emplace(label_reader(source.labels->format).extension);
    }
    for (const FoundFrames& frames : places) {
      if (!frames.stems.empty()) image_folders_.insert(frames.root);
      for (const std::string& name : frames.folders) image_folders_.insert(frames.root / name);
    }
  }

  UnreadLabels found;

  enum class Place {
    kGiven,
    kLabelsBeside,  ///< a tree of labels: as in what was given, a file that is damaged is told, too
    kBeside,
  };
  void look_below(const fs::path& top, int depth, Place place) {
    place_ = place;
    std::deque<std::pair<fs::path, int>> folders = {{top, depth}};
    for (; !folders.empty() && found.lines.size() < kMostLines; folders.pop_front()) {
      const auto [folder, levels] = folders.front();
      if (!known_.insert(folder).second) continue;
      if (known_.size() > kMostFolders) return cut();
      // What lies beside images, the dataset itself counts where it has labels.
      if (has_labels_ && image_folders_.contains(folder)) continue;
      const FolderListing listing = look_into(folder);
      if (levels < depth && has_other_images(folder, listing)) continue;
      look_at_files(folder, listing.files);
      if (levels == 0) continue;
      for (const std::string& name : listing.folders) {
        const bool is_other = starts_with_any(name, {".", "calib", "oxts", "velodyne"});
        if (!is_other) folders.emplace_back(folder / name, levels - 1);
      }
    }
  }

 private:
  void cut() {
    if (has_labels_ || !found.lines.empty()) return;
    found.limit = "labels were looked for in the first " + std::to_string(kMostFolders) +
                  " folders and " + std::to_string(kMostFiles) + " files alone";
  }

  /// A folder of images that none of the source's lie in: another dataset.
  bool has_other_images(const fs::path& folder, const FolderListing& listing) const {
    return std::ranges::any_of(listing.folders, [&](const std::string& name) {
      const fs::path images = folder / name;
      const auto first = image_folders_.lower_bound(images);
      const bool is_ours =
          first != image_folders_.end() &&
          std::mismatch(images.begin(), images.end(), first->begin(), first->end()).first ==
              images.end();
      return may_have_images(name) && !is_ours;
    });
  }

  void look_at_files(const fs::path& folder, const std::vector<std::string>& names) {
    std::map<std::pair<std::string, bool>, std::size_t> looked;
    const std::size_t told_before = found.others.size();
    bool are_all = true;
    for (const std::string& name : names) {
      const fs::path file = folder / name;
      const std::string extension = lower_extension(file);
      const bool may_be = std::ranges::find(kExtensions, extension) != kExtensions.end() &&
                          !own_extensions_.contains(extension) &&
                          !starts_with_any(name, {".", "readme", "licen", "calib", "times"});
      if (!may_be || is_read(file) || told_.contains(name)) continue;
      fs::path stem = file.stem();
      if (!images_.is_stem(stem.string()) && images_.find(stem.string()) != nullptr) {
        stem = stem.stem();  // im0.jpg.json
      }
      const bool is_of_image = images_.is_stem(stem.string());
      const std::size_t most = is_of_image ? kMostOfImages : kMostOthers;
      if (++looked[{extension, is_of_image}] > most) {
        are_all = false;
        continue;
      }
      if (++opened_ > kMostFiles) return cut();
      const LabelFile seen{file,
                           images_,
                           files_,
                           is_of_image,
                           images_.is_sequence(stem.string()),
                           beginning_of(file)};
      if (seen.text.empty() && place_ != Place::kBeside && !has_labels_) {
        tell_empty(seen, extension);
      } else if (seen.text.starts_with("\xFF\xFE") || seen.text.starts_with("\xFE\xFF")) {
        look_at_utf16(seen, extension);
      } else {
        look_at(seen, extension);
      }
    }
    found.are_more |= !are_all && found.others.size() > told_before;
  }

  /// Of empty files only those that labels would be in: a text is empty of an image without
  /// objects.
  void tell_empty(const LabelFile& file, const std::string& extension) {
    std::string reason = "it is empty";
    const bool is_readable = InputFile::open(file.path, reason).has_value();
    const bool is_of_labels = extension == ".csv" || extension == ".json" || extension == ".xml";
    if (is_passed_through(file, extension) || (is_readable && !is_of_labels)) return;
    tell(file, "empty" + extension + file.path.parent_path().string(), " is not read: " + reason);
  }

  void look_at_utf16(LabelFile file, const std::string& extension) {
    file.text.erase(0, 2);
    std::erase(file.text, '\0');
    if (is_passed_through(file, extension)) return;
    const Said said = said_by(file, extension);
    const std::string_view header = std::string_view(file.text).substr(0, file.text.find('\n'));
    const bool may_be = said.has_numbers && (file.is_of_image || said.names_images);
    if (!may_be || is_of_files(header) || is_of_cameras(file.text)) return;
    if (has_labels_) return found.others.push_back(file.path.string());
    tell(file, "UTF-16" + extension, " is UTF-16, and is not read: save it as UTF-8");
  }

  /// An image's own JSON.
  bool is_passed_through(const LabelFile& file, const std::string& extension) const {
    return extension == ".json" && images_.is_stem(file.path.stem().string()) &&
           image_folders_.contains(file.path.parent_path());
  }

  /// Whether a JSON file ends before its document does.
  static bool is_cut_short(const fs::path& path) {
    const InputFile file(path);
    const std::uint64_t count = std::min<std::uint64_t>(file.size_bytes(), 4096);
    const std::string end = file.read(file.size_bytes() - count, count);
    const std::string_view last = trimmed(end);
    return last.empty() || (last.back() != '}' && last.back() != ']');
  }

  /// Whether it has the labels that were found, or has been told of.
  bool is_read(const fs::path& file) const {
    return std::ranges::any_of(sources_, [&](const FoundSource& source) {
      const auto told = [&](const std::string& line) { return line.ends_with(file.string()); };
      const auto is_begin = [&](const std::string& line) {
        return line.starts_with(file.string() + " ");
      };
      return (has_labels_ && std::ranges::any_of(source.remarks, told)) || file == source.ids ||
             std::ranges::any_of(source.unread, is_begin) ||
             (source.labels && file == source.labels->path);
    });
  }

  void look_at(const LabelFile& file, const std::string& extension) {
    if (has_own_mark(file.text) || is_manifest(file.text)) return;
    const UnreadFormat* format = has_labels_ ? nullptr : unread_format_of(file, extension);
    if (format && is_of_these(file, extension)) {
      const std::string title(format->title);
      return tell(file, title + extension,
                  " looks like " + title + " labels of these images and is not read: " +
                      std::string(format->reason) + "; " + std::string(format->advice));
    }
    const std::string_view header = std::string_view(file.text).substr(0, file.text.find('\n'));
    if (is_passed_through(file, extension) || is_of_cameras(file.text) || is_of_files(header))
      return;
    const Said said = said_by(file, extension);
    const bool is_named = file.is_of_image || file.is_of_sequence;
    if (!said.names_images && !(is_named && said.has_numbers)) return;
    if (has_labels_ || !said.has_numbers) {
      if (said.has_words || said.has_numbers) found.others.push_back(file.path.string());
      return;
    }
    const bool is_damaged = extension == ".json" && is_cut_short(file.path);
    tell(file, extension + file.path.parent_path().string(),
         (said.names_images ? " names these images" : " has the name of one of these") +
             std::string(is_damaged
                             ? " and is not read: it ends before its JSON does"
                             : " and is not read: no reader of its format; convert it to COCO, "
                               "YOLO or Pascal VOC, or to a table image,class,left,top,right,"
                               "bottom"));
  }

  /// What lies beside what was given may be another dataset's.
  bool is_of_these(const LabelFile& file, const std::string& extension) const {
    const auto is_ours = [&](const std::string& name) { return images_.find(name) != nullptr; };
    return place_ == Place::kGiven || file.is_of_image || file.is_of_sequence ||
           said_by(file, extension).names_images ||
           (extension == ".json" && std::ranges::any_of(file.json().file_names, is_ours));
  }

  void tell(const LabelFile& file, const std::string& kind, const std::string& text) {
    told_.insert(file.path.filename().string());
    if (kinds_.insert(kind).second) found.lines.push_back(file.path.string() + text);
  }

  WholeFiles& files_;
  ImageNames images_;
  const std::vector<FoundSource>& sources_;
  bool has_labels_ = false;
  Place place_ = Place::kGiven;
  std::set<fs::path> image_folders_, known_;
  std::set<std::string> own_extensions_;  ///< of files that the labels are, one an image
  std::set<std::string> told_, kinds_;
  std::size_t opened_ = 0;
};

}  // namespace

const ImageNames& ImageNames::list() const {
  if (std::exchange(is_listed_, true)) return *this;
  for (const FoundFrames& frames : places_) {
    stems_.insert(frames.stems.begin(), frames.stems.end());
    are_videos_ |= frames.is_video;
    const bool are_places = std::ranges::all_of(frames.folders, [&](const std::string& name) {
      return std::ranges::find(places_, frames.root / name, &FoundFrames::root) != places_.end();
    });
    if (!frames.folders.empty() && !are_places) {
      for (const fs::path image : image_names_of(frames)) stems_.insert(image.stem().string());
    }
    for (const fs::path folder : frames.folders) {
      const std::string name = folder.filename().string();
      if (split_of(name).empty()) sequences_.insert(name);
    }
  }
  for (const char* name : {"images", "img", "imgs", "img1", "data", "JPEGImages"}) {
    sequences_.erase(name);
  }
  return *this;
}

bool ImageNames::is_sequence(const std::string& stem) const {
  return std::ranges::any_of(list().sequences_, [&](const std::string& name) {
    return stem == name || stem.starts_with(name + "_");
  });
}

const std::string* ImageNames::find(std::string_view text) const {
  const std::size_t folder = text.find_last_of("/\\");
  const std::string name(text.substr(folder == text.npos ? 0 : folder + 1));
  const std::size_t dot = name.rfind('.');
  const bool has_extension = dot != name.npos && is_image_or_video(name);
  const auto& known = list().stems_;
  auto found = known.find(has_extension ? name.substr(0, dot) : name);
  if (found == known.end() && are_videos_ && folder != text.npos) {  // clip/000012
    found = known.find(fs::path(text.substr(0, folder)).stem().string());
  }
  if (found == known.end()) return nullptr;
  constexpr std::size_t kLong = 8;
  const std::string& stem = *found;
  const bool is_number = std::ranges::all_of(stem, is_digit);
  const bool is_told = is_number ? stem.size() >= kLong || (stem.size() > 3 && stem[0] == '0')
                                 : stem.size() > 1 && std::ranges::any_of(stem, is_digit);
  return has_extension || folder != text.npos || is_told ? &stem : nullptr;
}

UnreadLabels unread_labels(const std::vector<FoundFrames>& places, const fs::path& given,
                           const std::vector<FoundSource>& sources) {
  if (places.empty()) return {};
  UnreadFinder finder(places, sources);
  const fs::path top = has_folder(given) ? given : given.parent_path();
  using enum UnreadFinder::Place;
  finder.look_below(top, has_folder(given) ? kDepth : 0, has_folder(given) ? kGiven : kBeside);
  // Beside it, and where a tree of labels stands beside that of images.
  constexpr int kLevels = 4;
  fs::path rest, folder = top;
  for (int level = 0; level < kLevels && folder.has_relative_path(); ++level) {
    const fs::path above = folder.parent_path();
    const bool is_beside = level == 0 || may_have_images(folder.filename().string());
    if (is_beside) finder.look_below(above, 0, kBeside);
    for (const std::string& name : look_into(above).folders) {
      if (above / name == folder ||
          !starts_with_any(name, {"label", "ann", "xml", "json", "gt", "ground", "box", "bbox"})) {
        continue;
      }
      const fs::path labels = rest.empty() ? above / name : above / name / rest;
      if (has_folder(labels)) finder.look_below(labels, kDepth, kLabelsBeside);
      if (is_beside) finder.look_below(above / name, kDepth, kLabelsBeside);
    }
    rest = rest.empty() ? folder.filename() : folder.filename() / rest;
    folder = above;
  }
  return std::move(finder.found);
}

}  // namespace eventgan

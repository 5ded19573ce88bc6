#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/files/csv_records.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/find_labels.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// What is seen of a file that may have labels.
struct LabelFile {
  const fs::path& path;
  const FoundFrames& frames;
  bool is_of_image;  ///< has the name of an image or a folder of images
  std::string text;  ///< its beginning

  const JsonGlimpse& json() const { return frames.files->json(path); }
};

/// Columns of a text's first line that says something, if all are numbers.
std::size_t number_columns(std::string_view text, char separator) {
  for (const TextLine& line : split_lines(text)) {
    if (trimmed(line.bytes).empty()) continue;
    CsvReader reader(trimmed(line.bytes), separator);
    const auto row = reader.next();
    // VisDrone's lines may end in a comma.
    const auto is_number = [](std::string_view field) {
      return field.empty() || parse_number<double>(field).has_value();
    };
    const bool are_numbers =
        row && row->fault.empty() && std::ranges::all_of(row->fields, is_number);
    return are_numbers ? row->fields.size() : 0;
  }
  return 0;
}

bool is_kitti_text(const LabelFile& file) {
  for (const TextLine& line : split_lines(file.text)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    return columns.size() >= 15 && columns.size() <= 16 && !parse_number<double>(columns[0]) &&
           std::all_of(columns.begin() + 1, columns.end(), [](std::string_view column) {
             return parse_number<double>(column).has_value();
           });
  }
  return false;
}

bool is_dota_text(const LabelFile& file) {
  for (const TextLine& line : split_lines(file.text)) {
    const auto columns = split_columns(line.bytes);
    if (columns.size() < 9) continue;  // "imagesource:GoogleEarth", "gsd:0.1"
    return columns.size() <= 10 && !parse_number<double>(columns[8]) &&
           std::all_of(columns.begin(), columns.begin() + 8, [](std::string_view column) {
             return parse_number<double>(column).has_value();
           });
  }
  return false;
}

/// A table whose rows begin with one of the images, or whose header has them and edges.
bool is_table(const LabelFile& file) {
  const std::string_view line = std::string_view(file.text).substr(0, file.text.find('\n'));
  CsvReader reader(file.text, separator_of(file.text));
  std::vector<std::string> images;
  for (int row = 0; row < 100; ++row) {
    const auto record = reader.next();
    if (!record) break;
    if (record->fields.size() < 5) return false;
    for (const std::string_view field : record->fields) {
      if (fs::path(field).has_extension()) images.emplace_back(field);
    }
  }
  const std::string header = in_small_letters(std::string(line));
  const bool has_edges = header.find("min") != header.npos || header.find("x1") != header.npos ||
                         header.find("left") != header.npos || header.find("box") != header.npos ||
                         header.find("region") != header.npos ||
                         std::ranges::any_of(std::string("0123456789"), [&](char digit) {
                           return header.find(digit) != header.npos;  // no header at all
                         });
  return has_edges && count_among(file.frames, images) > 0;
}

/// A format that is known by sight alone.
struct UnreadFormat {
  std::string_view title, extension;
  bool (*fits)(const LabelFile& file);
  std::string_view reason, advice;
};

constexpr std::string_view kNoReader = "no reader of this format";
constexpr std::string_view kCvatAdvice =
    "export the task from CVAT as COCO 1.0, YOLO 1.1 or Pascal VOC 1.1";

constexpr std::array kUnreadFormats{
    UnreadFormat{"CVAT's XML", ".xml",
                 [](const LabelFile& file) {
                   return file.text.find("<annotations") != std::string::npos &&
                          (file.text.find("<image ") != std::string::npos ||
                           file.text.find("<track ") != std::string::npos);
                 },
                 kNoReader, kCvatAdvice},
    UnreadFormat{"Pascal VOC's", ".xml",
                 [](const LabelFile& file) {
                   return file.is_of_image && file.text.find("<annotation") != std::string::npos;
                 },
                 "it lies in none of the folders where these are looked for",
                 "put the files beside the images or into Annotations beside their folder"},
    UnreadFormat{"labelme's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"shapes", "imagePath"});
                 },
                 kNoReader, "convert them with labelme2coco, or labelme2yolo"},
    UnreadFormat{"COCO", ".json", [](const LabelFile& file) { return file.json().is_coco(); },
                 "none of the images it lists is here",
                 "name the images as its file_name does, or give the folder with its images"},
    UnreadFormat{"COCO's panoptic", ".json",
                 [](const LabelFile& file) {
                   const auto& keys = file.json().annotation_keys;
                   return std::ranges::find(keys, "segments_info") != keys.end();
                 },
                 "segments are no boxes", "take the dataset's instances file"},
    UnreadFormat{"CreateML's", ".json",
                 [](const LabelFile& file) {
                   return file.json().is_list &&
                          (file.json().has_keys({"image", "annotations"}) ||
                           file.json().has_keys({"imagefilename", "annotation"}));
                 },
                 kNoReader, "export the dataset as COCO, YOLO or Pascal VOC"},
    UnreadFormat{"Label Studio's", ".json",
                 [](const LabelFile& file) {
                   const JsonGlimpse& json = file.json();
                   return json.is_list && (json.has_keys({"data", "annotations"}) ||
                                           json.has_keys({"data", "completions"}) ||
                                           json.has_keys({"image", "label", "annotator"}) ||
                                           json.has_keys({"image", "annotation_id"}));
                 },
                 kNoReader, "export the project as COCO or YOLO, or use label-studio-converter"},
    UnreadFormat{
        "COCO's results", ".json",
        [](const LabelFile& file) {
          return file.json().is_list && file.json().has_keys({"image_id", "bbox", "score"});
        },
        "a detector's results have no list of images", "give the ground truth"},
    UnreadFormat{"VIA's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"_via_img_metadata"}) ||
                          file.text.find("\"region_attributes\"") != std::string::npos;
                 },
                 kNoReader, "export it from VIA as COCO"},
    UnreadFormat{"BDD100K's", ".json",
                 [](const LabelFile& file) {
                   return file.json().is_list && file.json().has_keys({"name", "labels"});
                 },
                 kNoReader, "convert it with bdd100k.label.to_coco"},
    UnreadFormat{"Supervisely's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"objects", "size", "tags"});
                 },
                 kNoReader, "export the project as COCO or YOLO"},
    UnreadFormat{"Datumaro's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"categories", "items"});
                 },
                 kNoReader, "convert it with datum convert -f coco"},
    UnreadFormat{"VisDrone's", ".txt",
                 [](const LabelFile& file) {
                   const std::size_t columns = number_columns(file.text, ',');
                   return file.is_of_image && columns >= 8 && columns <= 11;
                 },
                 kNoReader,
                 "convert them to YOLO (ultralytics' VisDrone.yaml has a script) or COCO"},
    UnreadFormat{"YOLO", ".txt",
                 [](const LabelFile& file) {
                   return file.is_of_image && is_yolo_text(file.text).value_or(false);
                 },
                 "it lies in none of the folders where these are looked for",
                 "put it beside its image, or into labels/FOLDER for images/FOLDER"},
    UnreadFormat{"KITTI's", ".txt",
                 [](const LabelFile& file) { return file.is_of_image && is_kitti_text(file); },
                 "texts as KITTI has them are read as the dataset kitti_object",
                 "name the folders training/image_2 and training/label_2, and give the one above"},
    UnreadFormat{"DOTA's", ".txt",
                 [](const LabelFile& file) { return file.is_of_image && is_dota_text(file); },
                 kNoReader, "convert them to COCO or YOLO with upright boxes"},
    UnreadFormat{"a table of", ".csv", is_table, "its columns are others",
                 "name them image,class,left,top,right,bottom in a first line"},
    UnreadFormat{"a table of", ".tsv", is_table, "tables are .csv", "rename it to .csv"},
};

/// Files of which one in each folder tells: those of single images, after this many of them.
constexpr std::size_t kMostOfImages = 3;
constexpr std::size_t kMostOthers = 50;

class UnreadFinder {
 public:
  void look_into_folder(const fs::path& folder, const FoundFrames& frames) {
    if (folder.empty() || !known_.insert(folder).second) return;
    std::map<std::pair<std::string, bool>, std::size_t> looked;
    for (const std::string& name : look_into(folder).files) {
      const fs::path file = folder / name;
      const std::string extension = in_small_letters(file.extension().string());
      const bool is_label = std::ranges::any_of(kUnreadFormats, [&](const UnreadFormat& format) {
        return format.extension == extension;
      });
      if (name.starts_with('.') || !is_label) continue;
      const std::string stem = file.stem().string();
      if (looked[{extension, true}] > kMostOfImages && looked[{extension, false}] > kMostOthers) {
        continue;
      }
      const bool is_of_image = frames.stems.contains(stem) ||
                               std::ranges::find(frames.folders, stem) != frames.folders.end() ||
                               (!frames.folders.empty() && count_among(frames, {stem}) > 0);
      const std::size_t most = is_of_image ? kMostOfImages : kMostOthers;
      if (++looked[{extension, is_of_image}] > most) continue;
      look_at({file, frames, is_of_image, beginning_of(file)}, extension);
    }
  }

  std::vector<std::string> lines() const { return lines_; }

 private:
  void look_at(const LabelFile& file, const std::string& extension) {
    for (const UnreadFormat& format : kUnreadFormats) {
      if (format.extension != extension || !format.fits(file)) continue;
      if (!told_.insert(std::string(format.title) + format.extension.data()).second) return;
      lines_.push_back(file.path.string() + " looks like " + std::string(format.title) +
                       " labels of these images and is not read: " + std::string(format.reason) +
                       "; " + std::string(format.advice));
      return;
    }
  }

  std::set<fs::path> known_;
  std::set<std::string> told_;
  std::vector<std::string> lines_;
};

}  // namespace

std::vector<std::string> unread_labels(const std::vector<FoundFrames>& places) {
  UnreadFinder finder;
  for (const FoundFrames& frames : places) {
    std::vector<fs::path> folders = folders_around(frames);
    for (const fs::path& above : {frames.root, frames.root.parent_path()}) {
      for (const char* name : {"labels", "label", "label_2", "xml", "xmls", "json"}) {
        folders.push_back(frames.files->folder(above, name));
      }
    }
    for (const std::string& name : frames.folders) folders.push_back(frames.root / name);
    for (const fs::path& folder : folders) finder.look_into_folder(folder, frames);
  }
  return finder.lines();
}

}  // namespace eventgan

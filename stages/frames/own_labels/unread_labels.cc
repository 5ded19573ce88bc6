#include <zlib.h>

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include "manifests/files/csv_records.h"
#include "manifests/files/own_file.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/find_labels.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The names of all images and videos of a source, once a file asks for them.
class ImageNames {
 public:
  explicit ImageNames(const std::vector<FoundFrames>& places) : places_(places) {}

  bool is_stem(const std::string& stem) const { return list().stems_.contains(stem); }

  /// Of a folder of images, or of it and more: "M0101_gt_whole".
  bool is_sequence(const std::string& stem) const {
    return std::ranges::any_of(list().sequences_, [&](const std::string& name) {
      return stem == name || stem.starts_with(name + "_");
    });
  }

  /// The one that a text names: by its path, with an extension or without. A number alone may be
  /// anything, unless it has zeros before it or many digits; a word alone, too.
  const std::string* find(std::string_view text) const {
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

 private:
  static bool is_image_or_video(const fs::path& name) {
    return is_video_name(name) ||
           std::ranges::find(kImageExtensions, lower_extension(name)) != kImageExtensions.end();
  }

  const ImageNames& list() const {
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

  const std::vector<FoundFrames>& places_;
  mutable bool is_listed_ = false, are_videos_ = false;
  mutable std::unordered_set<std::string> stems_;
  mutable std::set<std::string> sequences_;
};

/// What is seen of a file that may have labels.
struct LabelFile {
  const fs::path& path;
  const ImageNames& images;
  WholeFiles& files;
  bool is_of_image;     ///< has the name of an image
  bool is_of_sequence;  ///< has that of a folder of images
  std::string text;     ///< its beginning

  const JsonGlimpse& json() const { return files.json(path); }
  bool has(std::string_view word) const { return text.find(word) != text.npos; }
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

/// Whether a text is of cameras or of photographs' EXIF data, and has no labels beside.
bool is_of_cameras(const std::string& text) {
  constexpr std::array<std::string_view, 22> kCameras{"exiftool",      "exifversion",
                                                      "\"exif",        "sourcefile",
                                                      "phototaken",    "exposuretime",
                                                      "exposure_time", "fnumber",
                                                      "xmpmeta",       "nonrealtimemeta",
                                                      "webpage_url",   "gpslatitude",
                                                      "calib",         "intrinsic",
                                                      "extrinsic",     "camera_matrix",
                                                      "cameramatrix",  "distortion",
                                                      "camera_model",  "transform_matrix",
                                                      "camera_id",     "p2:"};
  constexpr std::array<std::string_view, 7> kLabels{"box",     "annotation",   "keypoint",  "xmin",
                                                    "polygon", "segmentation", "\"labels\""};
  const std::string small = in_small_letters(text);
  const auto has = [&](std::string_view word) { return small.find(word) != small.npos; };
  return std::ranges::any_of(kCameras, has) && std::ranges::none_of(kLabels, has);
}

/// A table whose rows begin with one of the images, or whose header has them and edges.
/// Whether a table's header has a column of scores.
bool has_scores(std::string_view table) {
  const std::string header = in_small_letters(std::string(table.substr(0, table.find('\n'))));
  for (std::size_t begin = 0; begin <= header.size();) {
    const std::size_t end = std::min(header.find_first_of(",;\t\r", begin), header.size());
    const std::string_view name = std::string_view(header).substr(begin, end - begin);
    if (name == "score" || name == "scores" || name.starts_with("conf")) return true;
    begin = end + 1;
  }
  return false;
}

bool is_table(const LabelFile& file) {
  const std::string_view line = std::string_view(file.text).substr(0, file.text.find('\n'));
  CsvReader reader(file.text, separator_of(file.text));
  bool names_images = false;
  for (int row = 0; row < 100; ++row) {
    const auto record = reader.next();
    if (!record) break;
    if (record->fields.size() < 5) return false;
    names_images |= std::ranges::any_of(
        record->fields, [&](std::string_view field) { return file.images.find(field) != nullptr; });
  }
  const std::string header = in_small_letters(std::string(line));
  const bool has_edges = header.find("min") != header.npos || header.find("x1") != header.npos ||
                         header.find("left") != header.npos || header.find("box") != header.npos ||
                         header.find("region") != header.npos ||
                         std::ranges::any_of(std::string("0123456789"), [&](char digit) {
                           return header.find(digit) != header.npos;  // no header at all
                         });
  return has_edges && names_images && !is_of_cameras(file.text);
}

/// A sequence's boxes in its own folder, a line each: GOT-10k, LaSOT, OTB.
bool is_ground_truth(const LabelFile& file) {
  const std::string stem = file.path.stem().string();
  if (!stem.starts_with("groundtruth")) return false;
  const std::size_t columns =
      std::max(number_columns(file.text, ','), number_columns(file.text, '\t'));
  return columns == 4 || columns == 8;
}

bool has_any(const std::vector<std::string>& keys, std::string_view key) {
  return std::ranges::find(keys, key) != keys.end();
}

/// What is known of a kind of file that has no reader, or that no reader takes.
struct UnreadFormat {
  std::string_view title, extension;
  bool (*fits)(const LabelFile& file);
  std::string_view reason, advice;
};

constexpr std::string_view kNoBeside = "it lies in none of the folders where these are looked for";
constexpr std::string_view kNoReader = "no reader of this format";
constexpr std::string_view kCvatAdvice =
    "export the task from CVAT as COCO 1.0, YOLO 1.1 or Pascal VOC 1.1";

constexpr std::array kUnreadFormats{
    UnreadFormat{"CVAT's XML", ".xml",
                 [](const LabelFile& file) {
                   return file.has("<annotations") && (file.has("<image ") || file.has("<track "));
                 },
                 kNoReader, kCvatAdvice},
    UnreadFormat{"Pascal VOC's", ".xml",
                 [](const LabelFile& file) { return file.is_of_image && file.has("<annotation"); },
                 kNoBeside,
                 "put the files beside the images or into Annotations beside their folder"},
    UnreadFormat{"labelme's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"shapes", "imagePath"});
                 },
                 kNoReader, "convert them with labelme2coco, or labelme2yolo"},
    UnreadFormat{"PoseTrack's", ".json",
                 [](const LabelFile& file) {
                   return (file.is_of_sequence && file.json().is_coco()) ||
                          file.json().has_keys({"annolist"});
                 },
                 "a file a sequence is not looked for",
                 "join the files of all sequences into one of COCO, or give each its own source"},
    UnreadFormat{"COCO", ".json", [](const LabelFile& file) { return file.json().is_coco(); },
                 "none of the images it lists is here, or it lies where none is looked for",
                 "name the images as its file_name does, and put it beside their folder"},
    UnreadFormat{
        "COCO's panoptic", ".json",
        [](const LabelFile& file) { return has_any(file.json().annotation_keys, "segments_info"); },
        "segments are no boxes", "take the dataset's instances file"},
    UnreadFormat{
        "SoccerNet's", ".json",
        [](const LabelFile& file) { return has_any(file.json().annotation_keys, "bbox_image"); },
        kNoReader, "write each bbox_image as bbox: x, y, w and h, in a file of COCO"},
    UnreadFormat{"LVIS's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"images", "annotations"}) &&
                          file.json().file_names.empty() && file.has("\"coco_url\"");
                 },
                 "its images have no file_name",
                 "give each its file_name: the last two parts of its coco_url"},
    UnreadFormat{"COCO's keypoint", ".json",
                 [](const LabelFile& file) {
                   return !file.json().file_names.empty() &&
                          has_any(file.json().annotation_keys, "keypoints");
                 },
                 "its annotations have no bbox", "give each the bbox around its keypoints"},
    UnreadFormat{"YouTube-VIS's", ".json",
                 [](const LabelFile& file) {
                   return file.json().has_keys({"videos", "annotations"});
                 },
                 kNoReader, "write each frame as an image of COCO, with track_id"},
    UnreadFormat{"nuImages'", ".json",
                 [](const LabelFile& file) {
                   const JsonGlimpse& json = file.json();
                   return json.is_list && (json.has_keys({"token", "sample_data_token"}) ||
                                           json.has_keys({"token", "category_token"}));
                 },
                 kNoReader, "convert its tables to COCO, as nuscenes-devkit's export scripts do"},
    UnreadFormat{"AI Challenger's", ".json",
                 [](const LabelFile& file) {
                   const JsonGlimpse& json = file.json();
                   return json.is_list && (json.has_keys({"image_id", "human_annotations"}) ||
                                           json.has_keys({"image_id", "keypoint_annotations"}));
                 },
                 kNoReader, "convert it to COCO's keypoints, as MMPose's script does"},
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
                          file.has("\"region_attributes\"");
                 },
                 kNoReader, "export it from VIA as COCO"},
    UnreadFormat{"BDD100K's", ".json",
                 [](const LabelFile& file) {
                   return file.json().is_list &&
                          (file.json().has_keys({"name", "labels"}) ||
                           (file.json().has_keys({"name"}) && file.has("\"box2d\"")));
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
    UnreadFormat{
        "UA-DETRAC's", ".xml",
        [](const LabelFile& file) { return file.has("<sequence ") && file.has("<target_list"); },
        kNoReader, "convert it to MOT, a gt/gt.txt a sequence"},
    UnreadFormat{"CrowdHuman's", ".odgt",
                 [](const LabelFile& file) { return file.has("\"gtboxes\""); }, kNoReader,
                 "convert it to COCO: fbox is the person, the tag mask a box to ignore"},
    UnreadFormat{"Open Images'", ".csv",
                 [](const LabelFile& file) { return file.has("ImageID,") && file.has("XMin,"); },
                 "its edges are shares of the image",
                 "export it as COCO or YOLO, as FiftyOne does"},
    UnreadFormat{"GOT-10k's or LaSOT's", ".txt", is_ground_truth, kNoReader,
                 "write the sequence's gt/gt.txt as MOT has it: FRAME,1,LEFT,TOP,WIDTH,HEIGHT,1"},
    UnreadFormat{"UAVDT's", ".txt",
                 [](const LabelFile& file) {
                   return file.is_of_sequence && number_columns(file.text, ',') >= 8 &&
                          file.path.stem().string().find("_gt") != std::string::npos;
                 },
                 "it lies where none is looked for", "put it into SEQUENCE/gt/gt.txt: it is MOT's"},
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
                 kNoBeside, "put it beside its image, or into labels/FOLDER for images/FOLDER"},
    UnreadFormat{
        "KITTI's", ".txt",
        [](const LabelFile& file) { return file.is_of_image && is_kitti_text(file); },
        "texts as KITTI has them are read as the dataset kitti_object",
        "name the folders training/image_2 and training/label_2, and give the one above; "
        "if the classes are not KITTI's (Car, Van, Pedestrian, ...), convert them to COCO"},
    UnreadFormat{"DOTA's", ".txt",
                 [](const LabelFile& file) { return file.is_of_image && is_dota_text(file); },
                 kNoReader, "convert them to COCO or YOLO with upright boxes"},
    UnreadFormat{"a table of", ".csv",
                 [](const LabelFile& file) { return has_scores(file.text) && is_table(file); },
                 "it has a column of scores, as a detector's results",
                 "if it is the ground truth, take that column out"},
    UnreadFormat{"a table of", ".csv", is_table, "its columns or names of images are others",
                 "name them image,class,left,top,right,bottom in a first line"},
    UnreadFormat{"a table of", ".tsv", is_table, "tables are .csv", "rename it to .csv"},
    UnreadFormat{"a table of", ".txt", is_table, "tables are .csv",
                 "write it as .csv with a first line image,class,left,top,right,bottom"},
};

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
  static const std::set<std::string> kColumns{
      "image", "image_id", "filename", "file_name", "file",   "name",  "path",      "id",
      "width", "height",   "channels", "mode",      "size",   "bytes", "sequence",  "clip",
      "video", "index",    "frame",    "frame_id",  "number", "time",  "timestamp", "date",
      "fps",   "url",      "license",  "md5",       "sha256", "split", "set",       "camera"};
  const std::string text = in_small_letters(std::string(header));
  CsvReader reader(text, separator_of(text));
  const auto row = reader.next();
  return row && row->fields.size() > 1 &&
         std::ranges::all_of(row->fields, [](std::string_view field) {
           return kColumns.contains(std::string(trimmed(field)));
         });
}

/// What a file says of the images.
struct Said {
  bool names_images = false;
  bool has_numbers = false;  ///< as boxes, joints or tracks do
  bool has_words = false;    ///< more than names
};

std::vector<std::string_view> parts_of(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(separators, begin), text.size());
    if (end > begin) parts.push_back(trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

/// A line of a text: an image, and what stands beside it.
Said said_by_line(std::string_view line, const ImageNames& images) {
  Said said;
  std::size_t numbers = 0, others = 0;
  for (const std::string_view field : parts_of(line, ",;\t\"'|")) {
    const std::string_view folders = field.substr(0, field.find_last_of("/\\") + 1);
    if (folders.find(' ') == folders.npos && images.find(field) != nullptr) {
      said.names_images = true;
      continue;
    }
    for (const std::string_view part : parts_of(field, " =:()[]{}")) {
      constexpr std::size_t kHash = 32;
      const bool is_hash =
          part.size() >= kHash && part.find_first_not_of("0123456789abcdef") == part.npos;
      if (images.find(part) != nullptr) {
        said.names_images = true;
      } else if (parse_number<double>(part)) {
        ++numbers;
      } else if (!is_hash) {
        ++others;
      }
    }
  }
  said.has_numbers = numbers >= 2 && 2 * numbers >= others;
  said.has_words = others > 0;
  return said;
}

Said said_by_text(const LabelFile& file) {
  Said said;
  const bool is_named = file.is_of_image || file.is_of_sequence;
  for (const TextLine& line : split_lines(file.text)) {
    const Said of_line = said_by_line(line.bytes, file.images);
    said.names_images |= of_line.names_images;
    if (!of_line.names_images && !is_named) continue;
    said.has_numbers |= of_line.has_numbers;
    said.has_words |= of_line.has_words;
  }
  return said;
}

Said said_by_json(const LabelFile& file) {
  Said said;
  std::size_t numbers = 0;
  bool is_quoted = false;
  for (std::size_t begin = 0; begin < file.text.size(); is_quoted = !is_quoted) {
    const std::size_t end = std::min(file.text.find('"', begin), file.text.size());
    const std::string_view part = std::string_view(file.text).substr(begin, end - begin);
    begin = end + 1;
    if (is_quoted) {
      said.names_images = said.names_images || file.images.find(part) != nullptr;
      continue;
    }
    for (const std::string_view value : parts_of(part, ",:[]{} \n\r\t")) {
      numbers += parse_number<double>(value).has_value();
    }
  }
  constexpr std::size_t kBox = 4;
  const bool are_captions = file.has("\"caption\"") && !file.has("\"bbox\"");
  said.has_numbers = numbers >= kBox && !are_captions;
  said.has_words = true;
  return said;
}

/// Appends what a deflated stream begins with.
void inflate_into(std::string& text, std::string_view stream, int window_bits) {
  constexpr std::size_t kMost = std::size_t{1} << 18;
  z_stream state{};
  if (inflateInit2(&state, window_bits) != Z_OK) return;
  std::string inflated(kMost, '\0');
  state.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream.data()));
  state.avail_in = static_cast<uInt>(stream.size());
  state.next_out = reinterpret_cast<Bytef*>(inflated.data());
  state.avail_out = static_cast<uInt>(kMost);
  inflate(&state, Z_SYNC_FLUSH);  // what is cut off or damaged ends it
  text.append(inflated, 0, kMost - state.avail_out);
  inflateEnd(&state);
}

/// The beginning of a MAT file (version 5) or of an .npz, and what lies deflated in it.
std::string with_inflated(std::string_view bytes) {
  constexpr std::size_t kMost = std::size_t{1} << 22, kTag = 8, kMatHeader = 128, kMember = 30;
  const auto number = [&](std::size_t at, std::size_t width, bool little = true) {
    std::size_t value = 0;
    for (std::size_t i = 0; i < width; ++i) {
      value = value << 8 | static_cast<unsigned char>(bytes[at + (little ? width - 1 - i : i)]);
    }
    return value;
  };
  std::string text(bytes);
  if (bytes.starts_with("MATLAB 5.0")) {
    constexpr std::size_t kCompressed = 15;
    const bool little = bytes.substr(0, kMatHeader).ends_with("IM");
    for (std::size_t at = kMatHeader; at + kTag <= bytes.size() && text.size() < kMost;) {
      const std::size_t size = number(at + 4, 4, little);
      if (number(at, 4, little) == kCompressed) {
        inflate_into(text, bytes.substr(at + kTag, size), MAX_WBITS);
      }
      at += kTag + size;
    }
  }
  constexpr std::string_view kSignature = "PK\3\4";
  for (std::size_t at = bytes.starts_with(kSignature) ? 0 : bytes.npos;
       at < bytes.size() && at + kMember <= bytes.size() && text.size() < kMost;
       at = bytes.find(kSignature, at + 1)) {
    const std::size_t data = at + kMember + number(at + 26, 2) + number(at + 28, 2);
    const bool is_deflated = number(at + 8, 2) == Z_DEFLATED;
    if (is_deflated && data < bytes.size()) inflate_into(text, bytes.substr(data), -MAX_WBITS);
  }
  return text;
}

/// Whether an array of texts of one length, as NumPy has them, begins with one of the images.
bool has_array_of_names(std::string_view text, const ImageNames& images) {
  for (const auto& [type, letter_bytes] : {std::pair("'<U", 4), std::pair("'|S", 1)}) {
    const std::size_t at = text.find(type);
    if (at == text.npos) continue;
    const std::size_t digits = at + 3, end = text.find('\'', digits), begin = text.find('\n', at);
    if (end == text.npos || begin == text.npos) continue;
    const auto letters = parse_whole(text.substr(digits, end - digits));
    if (!letters || *letters <= 0 || *letters > 1000) continue;
    std::string name(
        text.substr(begin + 1, static_cast<std::size_t>(*letters) * std::size_t(letter_bytes)));
    std::erase(name, '\0');
    if (images.find(name) != nullptr) return true;
  }
  return false;
}

/// Of XML, MAT and NumPy files; letters of two or four bytes have zeros between them.
Said said_by_bytes(const LabelFile& file) {
  std::string text = with_inflated(file.text);
  Said said;
  said.names_images = has_array_of_names(text, file.images);
  std::erase(text, '\0');
  for (std::size_t begin = 0; begin < text.size() && !said.names_images;) {
    constexpr std::string_view kOfNames =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./\\";
    begin = std::min(text.find_first_of(kOfNames, begin), text.size());
    const std::size_t end = std::min(text.find_first_not_of(kOfNames, begin), text.size());
    said.names_images =
        file.images.find(std::string_view(text).substr(begin, end - begin)) != nullptr;
    begin = end;
  }
  said.has_numbers = said.has_words = true;
  return said;
}

Said said_by(const LabelFile& file, std::string_view extension) {
  if (extension == ".xml" || extension.starts_with(".m") || extension.starts_with(".np")) {
    return said_by_bytes(file);
  }
  const bool is_json =
      extension.starts_with(".j") || extension == ".ndjson" || extension == ".odgt";
  return is_json ? said_by_json(file) : said_by_text(file);
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
    static const std::map<LabelFormat, std::string_view> kOfFormat = {
        {LabelFormat::kYolo, ".txt"}, {LabelFormat::kMot, ".txt"}, {LabelFormat::kVoc, ".xml"}};
    for (const FoundSource& source : sources) {
      if (!source.labels) continue;
      has_labels_ = true;
      const auto own = kOfFormat.find(source.labels->format);
      if (own != kOfFormat.end()) own_extensions_.emplace(own->second);
    }
    for (const FoundFrames& frames : places) {
      if (!frames.stems.empty()) image_folders_.insert(frames.root);
      for (const std::string& name : frames.folders) image_folders_.insert(frames.root / name);
    }
  }

  UnreadLabels found;

  void look_below(const fs::path& top, int depth) {
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
      if (++looked[{extension, is_of_image}] > most) continue;
      if (++opened_ > kMostFiles) return cut();
      look_at({file, images_, files_, is_of_image, images_.is_sequence(stem.string()),
               beginning_of(file)},
              extension);
    }
  }

  /// Whether it has the labels that were found, or has been told of.
  bool is_read(const fs::path& file) const {
    return std::ranges::any_of(sources_, [&](const FoundSource& source) {
      const auto told = [&](const std::string& line) { return line.ends_with(file.string()); };
      return (has_labels_ && std::ranges::any_of(source.remarks, told)) || file == source.ids ||
             (source.labels && file == source.labels->path);
    });
  }

  void look_at(const LabelFile& file, const std::string& extension) {
    if (has_own_mark(file.text)) return;
    for (const UnreadFormat& format : kUnreadFormats) {
      if (has_labels_ || format.extension != extension || !format.fits(file)) continue;
      tell(file, std::string(format.title) + format.extension.data(),
           " looks like " + std::string(format.title) +
               " labels of these images and is not read: " + std::string(format.reason) + "; " +
               std::string(format.advice));
      return;
    }
    const bool is_passed_through = extension == ".json" &&
                                   images_.is_stem(file.path.stem().string()) &&
                                   image_folders_.contains(file.path.parent_path());
    const std::string_view header = std::string_view(file.text).substr(0, file.text.find('\n'));
    if (is_passed_through || is_of_cameras(file.text) || is_of_files(header)) return;
    const Said said = said_by(file, extension);
    const bool is_named = file.is_of_image || file.is_of_sequence;
    if (!said.names_images && !(is_named && said.has_numbers)) return;
    if (has_labels_ || !said.has_numbers) {
      if (said.has_words || said.has_numbers) found.others.push_back(file.path.string());
      return;
    }
    tell(
        file, extension + file.path.parent_path().string(),
        std::string(said.names_images ? " names these images" : " has the name of one of these") +
            " and is not read: no reader of its format; convert it to COCO, YOLO or Pascal VOC, or "
            "to a table image,class,left,top,right,bottom");
  }

  void tell(const LabelFile& file, const std::string& kind, const std::string& text) {
    told_.insert(file.path.filename().string());
    if (kinds_.insert(kind).second) found.lines.push_back(file.path.string() + text);
  }

  WholeFiles& files_;
  ImageNames images_;
  const std::vector<FoundSource>& sources_;
  bool has_labels_ = false;
  std::set<fs::path> image_folders_, known_;
  std::set<std::string> own_extensions_;  ///< of files that the labels are, one an image
  std::set<std::string> told_, kinds_;
  std::size_t opened_ = 0;
};

}  // namespace

UnreadLabels unread_labels(const std::vector<FoundFrames>& places, const fs::path& given,
                           const std::vector<FoundSource>& sources) {
  if (places.empty()) return {};
  UnreadFinder finder(places, sources);
  const fs::path top = has_folder(given) ? given : given.parent_path();
  finder.look_below(top, has_folder(given) ? kDepth : 0);
  // Beside it, and where a tree of labels stands beside that of images.
  constexpr int kLevels = 4;
  fs::path rest, folder = top;
  for (int level = 0; level < kLevels && folder.has_relative_path(); ++level) {
    const fs::path above = folder.parent_path();
    const bool is_beside = level == 0 || may_have_images(folder.filename().string());
    if (is_beside) finder.look_below(above, 0);
    for (const std::string& name : look_into(above).folders) {
      if (above / name == folder ||
          !starts_with_any(name, {"label", "ann", "xml", "json", "gt", "ground", "box", "bbox"})) {
        continue;
      }
      const fs::path labels = rest.empty() ? above / name : above / name / rest;
      if (has_folder(labels)) finder.look_below(labels, kDepth);
      if (is_beside) finder.look_below(above / name, kDepth);
    }
    rest = rest.empty() ? folder.filename() : folder.filename() / rest;
    folder = above;
  }
  return std::move(finder.found);
}

}  // namespace eventgan

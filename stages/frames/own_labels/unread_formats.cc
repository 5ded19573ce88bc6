#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "manifests/files/csv_records.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/own_labels/detail/csv_labels.h"
#include "stages/frames/own_labels/detail/label_file.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {
namespace {

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
    UnreadFormat{
        "MOT's", ".txt",
        [](const LabelFile& file) {
          const std::size_t columns = number_columns(file.text, ',');
          return file.is_of_image && file.images.are_videos() && columns >= 7 && columns <= 10;
        },
        "it lies where none is looked for", "put it into CLIP/gt/gt.txt beside the videos"},
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
                 [](const LabelFile& file) {
                   return has_score_column(file.text) &&
                          (is_table(file) || has_box_columns(file.text));
                 },
                 "it has a column of scores, as a detector's results",
                 "if it is the ground truth, take that column out"},
    UnreadFormat{"a table of", ".csv",
                 [](const LabelFile& file) { return has_box_header(file.text); },
                 "none of the images it names is here, or it lies where none is looked for",
                 "name images by their paths, a video's frames CLIP/12 from 0, and put it beside "
                 "their folder"},
    UnreadFormat{"a table of", ".csv",
                 [](const LabelFile& file) { return is_table(file) || has_box_columns(file.text); },
                 "its columns or names of images are others",
                 "name them image,class,left,top,right,bottom in a first line"},
    UnreadFormat{"a table of", ".tsv", is_table, "tables are .csv", "rename it to .csv"},
    UnreadFormat{"a table of", ".txt", is_table, "tables are .csv",
                 "write it as .csv with a first line image,class,left,top,right,bottom"},
};

}  // namespace

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

const UnreadFormat* unread_format_of(const LabelFile& file, std::string_view extension) {
  const auto format = std::ranges::find_if(kUnreadFormats, [&](const UnreadFormat& known) {
    return known.extension == extension && known.fits(file);
  });
  return format == kUnreadFormats.end() ? nullptr : &*format;
}

}  // namespace eventgan

#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// What classes and joints a YOLO dataset has.
struct YoloSchema {
  LabelSchema names;
  bool has_visibility = false;      ///< of joints: kpt_shape [J, 3]
  bool has_shape = false;           ///< kpt_shape is given; [0, 0] says that there are no joints
  bool are_joints_assumed = false;  ///< COCO's names of 17 that nothing names
};

/// Of data.yaml the keys `names` (a list, or a map from 0, 1, ...), `nc` (how many), `kpt_shape`
/// ([J, 2] or [J, 3]; [0, 0] of outlines), `kpt_names` (a list, or a map from classes to lists that
/// are all one) and `flip_idx`: 17 joints without names are COCO's unless it mirrors others. Throws
/// InputError if the text is no YAML, is longer than 1 MiB, or one of these is not so.
YoloSchema parse_yolo_yaml(const std::string& text, const std::string& path);

/// classes.txt: a name a line. Throws InputError if there is none, one is empty or there twice.
YoloSchema parse_yolo_classes(std::string_view text, const std::string& path);

/// Whether a YAML file has `names`, as far as its beginning tells.
bool has_yolo_names(const std::filesystem::path& yaml);

/// Which files of a folder name the classes, the best first: data.yaml, or the only other YAML file
/// with names; classes.txt, obj.names of CVAT, _darknet.labels of Roboflow.
std::vector<std::string> yolo_names_files(const std::filesystem::path& folder);
/// The first of them; empty if there is none.
std::string yolo_names_file(const std::filesystem::path& folder);

/// Of such a file, by its extension.
YoloSchema parse_yolo_names(const std::string& text, const std::string& path);

/// Whether a text is of YOLO's boxes, by its first line that says anything: a class, and shares of
/// the image. None if no line does.
std::optional<bool> is_yolo_text(std::string_view text);

/// The highest class of an image's text; -1: there is none. Where no file names the classes, their
/// numbers do.
int highest_yolo_class(std::string_view text);
YoloSchema numbered_yolo_classes(int highest);

/// Whether the lines of a source without kpt_shape may be boxes with joints. Outlines differ in
/// their numbers of corners; and as centre and size, their first two corners seldom make a box
/// within the image that has the others in it, as it has joints.
class PoseEvidence {
 public:
  void add(std::string_view text);

  /// Texts with lines beyond which nothing changes any more.
  bool is_enough() const { return texts_ >= kMostTexts || are_outlines_; }

  /// "kpt_shape: [12, 2] of ..., or ..., since 5 lines of 29 columns may be either": what the user
  /// is to choose from; empty where most lines are no boxes with joints.
  std::string doubt() const;

 private:
  static constexpr int kMostTexts = 1000;

  int texts_ = 0;
  int lines_ = 0;
  int longer_ = 0;           ///< of these, than a box's
  std::size_t columns_ = 0;  ///< of the longer ones
  int fitting_[2]{};         ///< of these, with two and with three numbers a joint
  bool are_outlines_ = false;
};

/// An image's text (kYoloReader): its boxes, and with joints its persons, in pixels of an image of
/// that size; `original` is the text. An outline among boxes (class and at least three points, of a
/// dataset without joints) has the box around it; parts that a bridge joins, there and back, are
/// parts. A line that is there already is left out, and counted in Annotation::left_out. A fault
/// names `path` and the line: another number of columns, a class beyond the names, a share beyond
/// 0..1 by more than 0.01; by less a box reaches beyond the image, and a joint is moved to its
/// edge.
Outcome<Annotation> parse_yolo_text(std::string text, const YoloSchema& schema, ImageSize image,
                                    const std::string& path);

}  // namespace eventgan

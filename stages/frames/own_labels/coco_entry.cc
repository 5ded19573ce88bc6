#include "stages/frames/own_labels/detail/coco_entry.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/documents/strict_json.h"
#include "manifests/values/faults.h"
#include "manifests/values/outlines.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {
namespace {

/// Takes 2.0 for 2: tools that compute with floating point write all numbers so.
void make_whole(nlohmann::json& value) {
  if (value.is_structured()) {
    for (nlohmann::json& element : value) make_whole(element);
  } else if (value.is_number_float()) {
    if (const auto number = whole_of(value.get<double>())) value = *number;
  }
}

/// A member that may be missing, or null.
std::optional<StrictValue> find_given(StrictObject& object, std::string_view key) {
  auto found = object.find(key);
  return found && found->is_null() ? std::nullopt : found;
}

/// An entry as a document whose faults are collected, and thrown all together.
class CocoEntry {
 public:
  /// `place` is the file, `what` the entry's kind; its id follows.
  CocoEntry(const std::string& text, const std::string& place, const std::string& what)
      : place_(place + " (" + what + ")"), faults_(place_) {
    auto document = parse_json_text(text, faults_);
    check();
    document_ = *std::move(document);
    make_whole(document_);
    const auto id = document_.find("id");
    if (id == document_.end()) return;
    place_ = place + " (" + what + " " + dump_json(*id, JsonLayout::kAsciiLine) + ")";
    faults_ = FaultList(place_);
  }

  const std::string& place() const { return place_; }
  const nlohmann::json& document() const { return document_; }
  StrictObject object() { return StrictValue(document_, faults_).object(); }
  void check() const {
    if (!faults_.empty()) throw BadLabel(faults_.text("; "));
  }

 private:
  std::string place_;
  FaultList faults_;
  nlohmann::json document_;
};

Rectangle read_bbox(const StrictValue& value) {
  const std::vector<StrictValue> sides = value.elements();
  if (sides.size() != 4) {
    value.fault("left, top, width, height");
    return {};
  }
  const double left = sides[0].number(-kFarthest_px, kFarthest_px);
  const double top = sides[1].number(-kFarthest_px, kFarthest_px);
  return {left, top, left + sides[2].number(0, kFarthest_px),
          top + sides[3].number(0, kFarthest_px)};
}

/// x, y of each corner.
std::vector<Point> read_polygon(const StrictValue& value) {
  const std::vector<StrictValue> numbers = value.elements();
  std::vector<Point> corners;
  if (numbers.size() % 2 != 0) {
    value.fault("x and y of each corner", std::to_string(numbers.size()) + " numbers");
    return corners;
  }
  for (std::size_t i = 0; i < numbers.size(); i += 2) {
    corners.push_back({numbers[i].number(-kFarthest_px, kFarthest_px),
                       numbers[i + 1].number(-kFarthest_px, kFarthest_px)});
  }
  return corners;
}

/// {"size": [height, width], "counts": run lengths or their text}.
Outline read_run_lengths(StrictObject object, ImageSize image) {
  constexpr int kLargest = 1'000'000;
  const StrictValue size = object.at("size");
  const StrictValue counts = object.at("counts");
  const std::vector<StrictValue> sides = size.elements();
  if (sides.size() != 2) {
    size.fault("height and width");
    return {};
  }
  const ImageSize told{sides[0].integer(0, kLargest), sides[1].integer(0, kLargest)};
  if (told != image) {
    size.fault(to_string(image) + ", the image's size", to_string(told));
    return {};
  }
  std::optional<std::vector<std::uint32_t>> runs;
  if (counts.is_text()) {
    runs = run_lengths(counts.text());
  } else {
    runs.emplace();
    for (const StrictValue& run : counts.elements()) {
      constexpr std::int64_t kMost = std::numeric_limits<std::uint32_t>::max();
      runs->push_back(static_cast<std::uint32_t>(run.integer<std::int64_t>(0, kMost)));
    }
  }
  const auto mask = runs ? mask_of(*runs, image) : std::nullopt;
  const std::size_t corners = mask ? corner_count(mask->pixels, image) : 0;
  if (corners > kMostCorners) {
    counts.fault("a mask of at most " + std::to_string(kMostCorners) + " corners",
                 std::to_string(corners));
    return {};
  }
  if (mask) return outline_of(*mask);
  counts.fault("run lengths of " + std::to_string(image.pixel_count()) + " pixels", "others");
  return {};
}

struct Segmentation {
  Outline outline = {};
  std::size_t parts = 0;         ///< polygons
  std::size_t without_area = 0;  ///< of these
};

/// None of a box without `segmentation`, or with an empty one.
Segmentation read_segmentation(StrictObject& object, ImageSize image) {
  const auto segmentation = find_given(object, "segmentation");
  if (!segmentation) return {};
  if (!segmentation->is_array()) return {read_run_lengths(segmentation->object(), image)};
  std::vector<std::vector<Point>> parts;
  for (const StrictValue& part : segmentation->elements()) parts.push_back(read_polygon(part));
  Segmentation read{.parts = parts.size()};
  read.outline = outline_of_parts(parts, &read.without_area);
  return read;
}

/// COCO has 0 or 1; many tools write false or true.
bool read_flag(const StrictValue& value) {
  return value.is_boolean() ? value.boolean() : value.integer(0, 1) == 1;
}

/// The object's number in its sequence: of CocoVID, TAO and PoseTrack, of BDD100K, of CVAT. -1 if
/// there is none, or another value, of which `other` is the first one then, in quotes.
std::int64_t read_track(const nlohmann::json& annotation, std::string& other) {
  constexpr std::uint64_t kMostTrack = std::numeric_limits<std::int64_t>::max();
  const auto member = [](const nlohmann::json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return object.is_object() && found != object.end() ? *found : nlohmann::json();
  };
  std::string unread;
  for (const nlohmann::json& track :
       {member(annotation, "track_id"), member(annotation, "instance_id"),
        member(member(annotation, "attributes"), "track_id")}) {
    bool is_none = track.is_null() || track == "" || track == -1;
    if (track.is_string()) {
      const auto number = parse_whole(track.get_ref<const std::string&>());
      if (number && *number >= 0) return *number;
      is_none |= number == -1;
    }
    const bool fits = !track.is_number_unsigned() || track.get<std::uint64_t>() <= kMostTrack;
    if (track.is_number_integer() && fits && track >= 0) return track;
    if (unread.empty() && !is_none) unread = in_quotes(dump_json(track));
  }
  other = unread;
  return Box().track_id;
}

/// COCO-WholeBody's joints beside the 17 of the body, in the order of its 133.
struct BodyPart {
  const char *key, *valid;
  std::size_t joints;
};
constexpr std::array<BodyPart, 4> kBodyParts{{{"foot_kpts", "foot_valid", 6},
                                              {"face_kpts", "face_valid", 68},
                                              {"lefthand_kpts", "lefthand_valid", 21},
                                              {"righthand_kpts", "righthand_valid", 21}}};
constexpr std::size_t kPartJoints = 116;

/// Of the face's 68 landmarks (iBUG's, as in 300-W) the one on its other side; itself in the
/// middle.
int mirrored_landmark(int i) {
  struct Row {
    int last, sum;
  };
  constexpr std::array<Row, 12> kRows{{{16, 16},
                                       {26, 43},
                                       {30, 0},
                                       {35, 66},
                                       {39, 81},
                                       {41, 87},
                                       {45, 81},
                                       {47, 87},
                                       {54, 102},
                                       {59, 114},
                                       {64, 124},
                                       {67, 132}}};
  const auto row = std::ranges::find_if(kRows, [&](const Row& of) { return i <= of.last; });
  return row->sum == 0 ? i : row->sum - i;
}

/// Names that tell the sides: a landmark of the left has the number of the right one.
std::vector<std::string> part_joint_names() {
  std::vector<std::string> names{"left_big_toe",  "left_small_toe",  "left_heel",
                                 "right_big_toe", "right_small_toe", "right_heel"};
  for (int i = 0; i < 68; ++i) {
    const int other = mirrored_landmark(i);
    names.push_back((i < other ? "right_" : (i > other ? "left_" : "")) + std::string("face_") +
                    std::to_string(std::min(i, other)));
  }
  for (const char* hand : {"left_hand_", "right_hand_"}) {
    for (int i = 0; i < 21; ++i) names.push_back(hand + std::to_string(i));
  }
  return names;
}

Joint joint_at(const StrictValue& x, const StrictValue& y, int visible) {
  constexpr double kHalf = 0.5;  // edges to pixels' centres
  return {{x.number(-kFarthest_px, kFarthest_px) - kHalf,
           y.number(-kFarthest_px, kFarthest_px) - kHalf},
          visible};
}

void read_part(StrictObject& object, const BodyPart& part, Person& person) {
  const auto list = find_given(object, part.key);
  const auto valid = find_given(object, part.valid);
  const std::vector<StrictValue> numbers =
      list && !(valid && !read_flag(*valid)) ? list->elements() : std::vector<StrictValue>();
  if (!numbers.empty() && numbers.size() != 3 * part.joints) {
    list->fault("x, y, v of each of " + std::to_string(part.joints) + " joints");
    return;
  }
  for (std::size_t i = 0; i < part.joints; ++i) {
    Joint& joint = person.joints.emplace_back(Joint{kMissingPoint, 0});
    if (numbers.empty()) continue;
    const double seen = numbers[3 * i + 2].number(0, 2);  // a detector's is a share
    if (seen == 0) continue;
    joint = joint_at(numbers[3 * i], numbers[3 * i + 1], seen == 2 ? 1 : (seen == 1 ? 0 : -1));
  }
}

/// Whether a joint of the annotation is annotated. `joints`: of the body, of which there may be no
/// names.
bool read_keypoints(StrictObject& object, std::size_t joints, bool has_names, bool has_parts,
                    Person& person) {
  const auto keypoints = find_given(object, "keypoints");
  const std::vector<StrictValue> numbers =
      keypoints ? keypoints->elements() : std::vector<StrictValue>();
  if (numbers.empty() && !has_parts) return false;  // of classes without joints
  if (!numbers.empty() && numbers.size() != 3 * joints) {
    if (!has_names) return false;
    keypoints->fault("x, y, v of each of " + std::to_string(joints) + " joints");
    return false;
  }
  for (std::size_t i = 0; i < joints; ++i) {
    Joint& joint = person.joints.emplace_back(Joint{kMissingPoint, 0});
    if (numbers.empty()) continue;
    const int visible = numbers[3 * i + 2].integer(0, 2);
    const Joint annotated = joint_at(numbers[3 * i], numbers[3 * i + 1], visible == 2 ? 1 : 0);
    if (visible > 0) joint = annotated;
  }
  for (const BodyPart& part : kBodyParts) {
    if (has_parts) read_part(object, part, person);
  }
  const auto is_annotated = [](const Joint& joint) { return joint.at != kMissingPoint; };
  return std::ranges::any_of(person.joints, is_annotated);  // num_keypoints counts otherwise
}

}  // namespace

CocoImage read_coco_image(const std::string& text, std::int64_t id, const std::string& path) {
  constexpr int kLargest = 1'000'000;
  CocoEntry entry(text, path, "image");
  StrictObject object = entry.object();
  CocoImage image;
  if (object.find("height") || object.find("width")) {
    image.size = ImageSize{object.at("height").integer(1, kLargest),
                           object.at("width").integer(1, kLargest)};
  }
  object.at("id").integer(id, id);  // another: the file has changed
  if (const auto lists_x = find_given(object, "ignore_regions_x")) {
    const StrictValue lists_y = object.at("ignore_regions_y");
    const std::vector<StrictValue> all_x = lists_x->elements(), all_y = lists_y.elements();
    for (std::size_t i = 0; i < std::max(all_x.size(), all_y.size()); ++i) {
      const auto x = i < all_x.size() ? all_x[i].elements() : std::vector<StrictValue>();
      const auto y = i < all_y.size() ? all_y[i].elements() : std::vector<StrictValue>();
      if (x.size() != y.size()) {
        lists_y.fault("as many numbers as ignore_regions_x has", "others");
        break;
      }
      auto& corners = image.ignored.emplace_back();
      for (std::size_t k = 0; k < x.size(); ++k) {
        corners.push_back(
            {x[k].number(-kFarthest_px, kFarthest_px), y[k].number(-kFarthest_px, kFarthest_px)});
      }
    }
  }
  entry.check();
  return image;
}

void add_ignored_regions(const CocoImage& entry, ImageSize image, const CocoIndex& index,
                         const std::string& place, Annotation& annotation) {
  const auto with_joints = std::ranges::find_if(
      index.categories, [](const auto& category) { return !category.keypoints.empty(); });
  const auto of = with_joints == index.categories.end() ? index.categories.begin() : with_joints;
  for (const std::vector<Point>& corners : entry.ignored) {
    const Outline outline = outline_of_parts({corners});
    add_box({.class_id = static_cast<int>(of - index.categories.begin()),
             .xyxy = bounds(outline),
             .ignore = true,
             .outline = outline},
            image, place, annotation);
  }
}

LabelSchema coco_schema(const CocoIndex& index, const std::string& path) {
  LabelSchema schema;
  for (const CocoIndex::Category& category : index.categories) {
    schema.class_names.push_back(category.name);
    if (category.keypoints.empty()) continue;
    if (schema.joint_names.empty()) schema.joint_names = category.keypoints;
    if (schema.joint_names == category.keypoints) continue;
    throw InputError("expected one list of keypoints, got two, of \"" + category.name +
                     "\" another, in " + path);
  }
  if (index.has_body_parts && !schema.joint_names.empty()) {
    std::ranges::move(part_joint_names(), std::back_inserter(schema.joint_names));
  }
  return schema;
}

void add_coco_annotation(const std::string& text, std::int64_t image_id, ImageSize image,
                         const CocoIndex& index, const LabelSchema& schema, const std::string& path,
                         Annotation& annotation) {
  CocoEntry entry(text, path, "annotation");
  StrictObject object = entry.object();
  object.at("image_id").integer(image_id, image_id);
  using Limits = std::numeric_limits<std::int64_t>;
  Box box;
  bool has_names = false;  // of its joints
  const StrictValue category = object.at("category_id");
  if (const auto id = category.sound_integer(Limits::min(), Limits::max())) {
    const auto known =
        std::ranges::lower_bound(index.categories, *id, {}, &CocoIndex::Category::id);
    if (known == index.categories.end() || known->id != *id) {
      category.fault("the id of a category");
    } else {
      box.class_id = static_cast<int>(known - index.categories.begin());
      has_names = !known->keypoints.empty();
    }
  }
  Segmentation segmentation = read_segmentation(object, image);
  box.outline = std::move(segmentation.outline);
  auto sides = find_given(object, "bbox");
  const bool is_told = sides && !(sides->is_array() && sides->elements().empty());
  if (!is_told && !box.outline.empty()) sides.reset();
  box.xyxy = !sides && !box.outline.empty() ? bounds(box.outline)
                                            : read_bbox(sides ? *sides : object.at("bbox"));
  for (const char* const key : {"iscrowd", "ignore"}) {
    if (const auto flag = find_given(object, key)) box.ignore |= read_flag(*flag);
  }
  std::string other_track;
  box.track_id = read_track(entry.document(), other_track);
  if (const auto area = find_given(object, "area")) area->number(0, kFarthest_px * kFarthest_px);
  Person person;
  const std::size_t joints = schema.joint_names.size();
  const bool has_parts = index.has_body_parts && joints > kPartJoints;
  const bool is_person =
      read_keypoints(object, joints - (has_parts ? kPartJoints : 0), has_names, has_parts, person);
  const auto head = is_person ? find_given(object, "bbox_head") : std::nullopt;  // PoseTrack's
  std::optional<Rectangle> head_box;
  if (head && !(head->is_array() && head->elements().empty())) head_box = read_bbox(*head);
  entry.check();
  if (!add_box(box, image, entry.place(), annotation)) return;
  note_parts_left_out(segmentation.without_area, segmentation.parts, entry.place(), annotation);
  if (!other_track.empty()) {
    annotation.tracks_left_out.push_back("expected a whole number from 0 as track, got " +
                                         other_track + ", in " + entry.place());
  }
  if (is_person) {
    person.box = box.xyxy;
    person.head_box = head_box;
    annotation.persons.push_back(std::move(person));
  }
}

}  // namespace eventgan

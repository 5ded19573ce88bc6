#include "stages/exports/detection_labels.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/outlines.h"

namespace eventgan {

std::string yolo_line(int class_number, const Rectangle& box, ImageSize volume) {
  const auto share = [](double value, int whole) { return std::clamp(value / whole, 0.0, 1.0); };
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f}", class_number,
                     share((box.left + box.right) / 2, volume.width),
                     share((box.top + box.bottom) / 2, volume.height),
                     share(box.right - box.left, volume.width),
                     share(box.bottom - box.top, volume.height));
}

namespace {

using Ring = std::vector<Point>;

/// Where a bridge between two rings begins and ends: the nearest corners, of very long rings of
/// some of them.
std::pair<std::size_t, std::size_t> bridge(const Ring& from, const Ring& to) {
  constexpr std::size_t kMost = 1000;
  const std::size_t step = 1 + from.size() / kMost, other_step = 1 + to.size() / kMost;
  std::pair<std::size_t, std::size_t> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < from.size(); i += step) {
    for (std::size_t j = 0; j < to.size(); j += other_step) {
      const double distance = std::hypot(from[i].x - to[j].x, from[i].y - to[j].y);
      if (distance >= least) continue;
      least = distance;
      best = {i, j};
    }
  }
  return best;
}

/// One ring that winds around each place as often as all of them do.
Ring joined(const std::vector<Ring>& rings) {
  Ring path;
  const auto visit = [&](const Ring& ring, std::size_t corner, std::size_t steps) {
    for (std::size_t i = 0; i <= steps; ++i) path.push_back(ring[(corner + i) % ring.size()]);
  };
  const auto steps = [](const Ring& ring, std::size_t from, std::size_t to) {
    return (to + ring.size() - from) % ring.size();
  };
  // Of each ring the way to the next one's bridge, all of the last ring, and back the other ways.
  struct Ends {
    std::size_t entry, exit;
  };
  std::vector<Ends> ends(rings.size(), Ends{0, 0});
  for (std::size_t i = 0; i + 1 < rings.size(); ++i) {
    const auto [exit, entry] = bridge(rings[i], rings[i + 1]);
    ends[i].exit = exit;
    ends[i + 1].entry = entry;
    visit(rings[i], ends[i].entry, steps(rings[i], ends[i].entry, exit));
  }
  visit(rings.back(), ends.back().entry, rings.back().size());
  for (std::size_t i = rings.size() - 1; i-- > 0;) {
    const std::size_t done = steps(rings[i], ends[i].entry, ends[i].exit);
    visit(rings[i], ends[i].exit, rings[i].size() - done);
  }
  path.pop_back();  // back at the first corner
  return path;
}

}  // namespace

std::string yolo_outline_line(int class_number, const Outline& outline, ImageSize volume) {
  const GreyImage mask = mask_of(outline, volume);
  const bool is_plain = mask == mask_of(outline, volume, FillRule::kByTurns);
  const Ring ring = joined(is_plain ? outline.rings : outline_of(mask).rings);
  std::string line = fmt::format("{}", class_number);
  for (const Point& corner : ring) {
    line += fmt::format(" {:.9f} {:.9f}", std::clamp(corner.x / volume.width, 0.0, 1.0),
                        std::clamp(corner.y / volume.height, 0.0, 1.0));
  }
  return line;
}

namespace {

constexpr double kToCentre = 0.5;  // from a pixel's edge, where the volume begins

/// The name with one side put for the other; empty if it does not begin or end with a side.
std::string other_side(const std::string& name) {
  struct Sides {
    std::string_view left, right;
  };
  static constexpr std::array<Sides, 5> kBegin{
      {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"}, {"l_", "r_"}, {"L_", "R_"}}};
  static constexpr std::array<Sides, 5> kEnd{
      {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"}, {"_l", "_r"}, {"_L", "_R"}}};
  for (const auto& [left, right] : kBegin) {
    if (name.starts_with(left)) return std::string(right) + name.substr(left.size());
    if (name.starts_with(right)) return std::string(left) + name.substr(right.size());
  }
  for (const auto& [left, right] : kEnd) {
    if (name.ends_with(left)) return name.substr(0, name.size() - left.size()) + std::string(right);
    if (name.ends_with(right))
      return name.substr(0, name.size() - right.size()) + std::string(left);
  }
  const auto is_upper = [](char c) { return c >= 'A' && c <= 'Z'; };
  std::string mirrored = name;
  if (name.size() > 1 && (name[0] == 'L' || name[0] == 'R') && is_upper(name[1])) {
    mirrored[0] = name[0] == 'L' ? 'R' : 'L';
    return mirrored;
  }
  return "";
}

}  // namespace

bool is_within(const ExportedJoint& joint, ImageSize volume) {
  const double x = joint.at.x + kToCentre;
  const double y = joint.at.y + kToCentre;
  return joint.at != kMissingPoint && x >= 0 && x <= volume.width && y >= 0 && y <= volume.height;
}

std::string yolo_pose_line(int class_number, const Rectangle& box,
                           const std::vector<ExportedJoint>& joints, ImageSize volume) {
  std::string line = yolo_line(class_number, box, volume);
  for (const ExportedJoint& joint : joints) {
    line += is_within(joint, volume)
                ? fmt::format(" {:.9f} {:.9f} {}", (joint.at.x + kToCentre) / volume.width,
                              (joint.at.y + kToCentre) / volume.height, joint.visible == 0 ? 1 : 2)
                : " 0 0 0";
  }
  return line;
}

std::optional<std::vector<int>> flip_indices(const std::vector<std::string>& joint_names) {
  std::vector<int> places(joint_names.size());
  bool has_sides = false;
  for (std::size_t i = 0; i < joint_names.size(); ++i) {
    const std::string other = other_side(joint_names[i]);
    const std::string& mirrored = other.empty() ? joint_names[i] : other;
    if (std::ranges::count(joint_names, mirrored) != 1) return std::nullopt;
    places[i] = static_cast<int>(std::ranges::find(joint_names, mirrored) - joint_names.begin());
    has_sides |= !other.empty();
  }
  return has_sides ? std::optional(places) : std::nullopt;
}

std::string yolo_data_yaml(const std::vector<std::string>& names, int channels,
                           const std::vector<std::string>& splits) {
  std::string text;
  for (const std::string& split : splits) text += fmt::format("{0}: {0}.txt\n", split);
  const auto has = [&](const char* name) {
    return std::ranges::find(splits, name) != splits.end();
  };
  if (has("train") && !has("val")) text += "val: train.txt\n";
  // A JSON list is a YAML list.
  return text + fmt::format("nc: {}\nchannels: {}\nnames: {}\n", names.size(), channels,
                            dump_json(nlohmann::json(names)));
}

std::string yolo_pose_yaml(const std::vector<std::string>& joint_names, int channels,
                           const std::vector<std::string>& splits) {
  std::string text = yolo_data_yaml({"person"}, channels, splits) +
                     fmt::format("kpt_shape: [{}, 3]\nkpt_names: {{0: {}}}\n", joint_names.size(),
                                 dump_json(nlohmann::json(joint_names)));
  if (const auto places = flip_indices(joint_names)) {
    text += fmt::format("flip_idx: {}\n", dump_json(nlohmann::json(*places)));
  }
  return text;
}

namespace {

using Json = nlohmann::ordered_json;

Json annotation(const CocoPlace& place, const Rectangle& box, bool is_crowd) {
  const double width = box.right - box.left;
  const double height = box.bottom - box.top;
  return {{"id", place.id},
          {"image_id", place.image_id},
          {"category_id", place.category_id},
          {"bbox", {box.left, box.top, width, height}},
          {"area", width * height},
          {"iscrowd", is_crowd ? 1 : 0}};
}

}  // namespace

std::string coco_image(std::int64_t id, const std::string& file_name, ImageSize volume,
                       const std::string& sample_id) {
  return dump_json(Json{{"id", id},
                        {"file_name", file_name},
                        {"width", volume.width},
                        {"height", volume.height},
                        {"sample_id", sample_id}});
}

std::string coco_box(const CocoPlace& place, const Rectangle& box, bool is_crowd,
                     const Outline& outline, ImageSize volume) {
  Json json = annotation(place, box, is_crowd);
  if (outline.empty()) return dump_json(json);
  const GreyImage mask = mask_of(outline, volume);
  json["area"] = std::ranges::count(mask.pixels, 1);
  const bool has_holes =
      std::ranges::any_of(outline.rings, [](const Ring& ring) { return twice_area(ring) < 0; });
  const auto is_filled_once = [&](const Ring& ring) {
    const Outline part{{ring}};
    return mask_of(part, volume) == mask_of(part, volume, FillRule::kByTurns);
  };
  // Parts may overlap each other, but none itself.
  const bool is_plain = !has_holes && (mask == mask_of(outline, volume, FillRule::kByTurns) ||
                                       std::ranges::all_of(outline.rings, is_filled_once));
  json["segmentation"] = !is_plain || is_crowd ? Json{{"size", {volume.height, volume.width}},
                                                      {"counts", compressed(run_lengths(mask))}}
                                               : Json::parse(outline_text(outline));
  return dump_json(json);
}

std::string coco_person(const CocoPlace& place, const Rectangle& box, bool is_crowd,
                        const std::vector<ExportedJoint>& joints, ImageSize volume) {
  Json json = annotation(place, box, is_crowd);
  int annotated = 0;
  Json keypoints = Json::array();
  for (const ExportedJoint& joint : joints) {
    if (!is_within(joint, volume)) {
      for (int i = 0; i < 3; ++i) keypoints.push_back(0);
      continue;
    }
    ++annotated;
    keypoints.push_back(joint.at.x + kToCentre);
    keypoints.push_back(joint.at.y + kToCentre);
    keypoints.push_back(joint.visible == 0 ? 1 : 2);
  }
  json["num_keypoints"] = annotated;
  json["keypoints"] = std::move(keypoints);
  return dump_json(json);
}

std::string coco_category(int id, const std::string& name) {
  return dump_json(Json{{"id", id}, {"name", name}});
}

std::string coco_person_category(int id, const std::string& name,
                                 const std::vector<std::string>& joint_names,
                                 const std::vector<std::pair<int, int>>& limbs) {
  Json skeleton = Json::array();
  for (const auto& [from, to] : limbs) skeleton.push_back({from + 1, to + 1});
  return dump_json(Json{{"supercategory", "person"},
                        {"id", id},
                        {"name", name},
                        {"keypoints", joint_names},
                        {"skeleton", std::move(skeleton)}});
}

}  // namespace eventgan

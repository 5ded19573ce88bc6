#include "stages/exports/detection_labels.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "manifests/documents/detail/json_text.h"

namespace eventgan {

std::string yolo_line(int class_number, const Rectangle& box, ImageSize volume) {
  const auto share = [](double value, int whole) { return std::clamp(value / whole, 0.0, 1.0); };
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f}", class_number,
                     share((box.left + box.right) / 2, volume.width),
                     share((box.top + box.bottom) / 2, volume.height),
                     share(box.right - box.left, volume.width),
                     share(box.bottom - box.top, volume.height));
}

std::string yolo_data_yaml(const std::vector<std::string>& names, int channels,
                           const std::vector<std::string>& splits) {
  std::string text = "path: .\n";
  for (const std::string& split : splits) text += fmt::format("{0}: {0}.txt\n", split);
  // A JSON list is a YAML list.
  return text + fmt::format("nc: {}\nchannels: {}\nnames: {}\n", names.size(), channels,
                            dump_json(nlohmann::json(names)));
}

namespace {

using Json = nlohmann::ordered_json;

Json annotation(const CocoPlace& place, const Rectangle& box) {
  const double width = box.right - box.left;
  const double height = box.bottom - box.top;
  return {{"id", place.id},
          {"image_id", place.image_id},
          {"category_id", place.category_id},
          {"bbox", {box.left, box.top, width, height}},
          {"area", width * height}};
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

std::string coco_box(const CocoPlace& place, const Rectangle& box, bool is_crowd) {
  Json json = annotation(place, box);
  json["iscrowd"] = is_crowd ? 1 : 0;
  return dump_json(json);
}

std::string coco_person(const CocoPlace& place, const Rectangle& box,
                        const std::vector<ExportedJoint>& joints) {
  constexpr double kToCentre = 0.5;
  Json json = annotation(place, box);
  json["iscrowd"] = 0;
  int annotated = 0;
  Json keypoints = Json::array();
  for (const ExportedJoint& joint : joints) {
    if (joint.at == kMissingPoint) {
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

#include <array>

#include "stages/scenes/layouts/mpii_annotation_internal.h"
#include "stages/scenes/layouts/output_files.h"

namespace eventgan {
namespace {

/// MPII's joints by id, as numbers of Human3.6M's.
constexpr std::array<Human36mJoint, 16> kMpiiJoints{
    kRightAnkle,    kRightKnee,    kRightHip,  kLeftHip,  kLeftKnee,   kLeftAnkle,
    kHips,          kThorax,       kNeck,      kHeadTop,  kRightWrist, kRightElbow,
    kRightShoulder, kLeftShoulder, kLeftElbow, kLeftWrist};

/// MPII counts pixels from 1.
double one_based(double coordinate) { return coordinate + 1; }

/// The forms in which MPII's files hold this flag.
MatValue visibility(std::size_t id, bool visible) {
  if (id == 6 || id == 7) return mat_empty();  // pelvis and thorax: not judged
  if (id % 2 == 0) return mat_byte(visible ? 1 : 0);
  return mat_text(visible ? "1" : "0");
}

MatValue points_of(const FigureLabel& label) {
  MatValue points = mat_struct(kMpiiJoints.size(), {"x", "y", "id", "is_visible"});
  for (std::size_t id = 0; id < kMpiiJoints.size(); ++id) {
    const Human36mJoint joint = kMpiiJoints[id];
    set_field(points, id, "x", mat_number(one_based(label.joints[joint].x)));
    set_field(points, id, "y", mat_number(one_based(label.joints[joint].y)));
    set_field(points, id, "id", mat_byte(static_cast<std::uint8_t>(id)));
    set_field(points, id, "is_visible", visibility(id, label.visible[joint]));
  }
  return points;
}

MatValue position_of(const FigureLabel& label) {
  // Edges lie half a pixel beyond the centres of the pixels they enclose.
  const Rectangle& box = label.outline;
  MatValue position = mat_struct(1, {"x", "y"});
  set_field(position, 0, "x", mat_number(one_based((box.left + box.right) / 2 - 0.5)));
  set_field(position, 0, "y", mat_number(one_based((box.top + box.bottom) / 2 - 0.5)));
  return position;
}

/// The people of a training picture. In a test picture only where they are and how large.
MatValue people_of(const DemoMpiiEntry& entry) {
  MatValue people = entry.train ? mat_struct(entry.people.size(), {"x1", "y1", "x2", "y2",
                                                                   "annopoints", "scale", "objpos"})
                                : mat_struct(entry.people.size(), {"scale", "objpos"});
  for (std::size_t i = 0; i < entry.people.size(); ++i) {
    const FigureLabel& label = entry.people[i];
    const double height = label.outline.bottom - label.outline.top;
    set_field(people, i, "scale", mat_number(height / 200));
    set_field(people, i, "objpos", position_of(label));
    if (!entry.train) continue;
    set_field(people, i, "x1", mat_number(one_based(label.head_box.left)));
    set_field(people, i, "y1", mat_number(one_based(label.head_box.top)));
    set_field(people, i, "x2", mat_number(one_based(label.head_box.right)));
    set_field(people, i, "y2", mat_number(one_based(label.head_box.bottom)));
    MatValue annopoints = mat_struct(1, {"point"});
    set_field(annopoints, 0, "point", points_of(label));
    set_field(people, i, "annopoints", std::move(annopoints));
  }
  return people;
}

MatValue image_of(const std::string& name) {
  MatValue image = mat_struct(1, {"name"});
  set_field(image, 0, "name", mat_text(name));
  return image;
}

MatValue annotations(const std::vector<DemoMpiiEntry>& entries) {
  MatValue list = mat_struct(entries.size(), {"image", "annorect", "frame_sec", "vididx"});
  for (std::size_t i = 0; i < entries.size(); ++i) {
    set_field(list, i, "image", image_of(entries[i].name + ".jpg"));
    set_field(list, i, "annorect", people_of(entries[i]));
    set_field(list, i, "frame_sec", mat_number(1));
    set_field(list, i, "vididx", mat_number(entries[i].video));
  }
  return list;
}

MatValue activities(const std::vector<DemoMpiiEntry>& entries) {
  MatValue list = mat_struct(entries.size(), {"cat_name", "act_name", "act_id"}, /*column=*/true);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    set_field(list, i, "cat_name", mat_text("walking"));
    set_field(list, i, "act_name", mat_text("walking and waving"));
    set_field(list, i, "act_id", mat_number(1));
  }
  return list;
}

}  // namespace

MatValue mpii_release(const std::vector<DemoMpiiEntry>& entries) {
  std::vector<double> train;
  std::vector<MatValue> single_person;
  std::vector<MatValue> videos;
  for (const DemoMpiiEntry& entry : entries) {
    train.push_back(entry.train ? 1 : 0);
    // Counted from 1; someone who stands with others is not single.
    single_person.push_back(entry.people.size() == 1 ? mat_number(1) : mat_empty());
    videos.push_back(mat_text("demo-" + entry.name));
  }
  MatValue release =
      mat_struct(1, {"annolist", "img_train", "version", "single_person", "act", "video_list"});
  set_field(release, 0, "annolist", annotations(entries));
  set_field(release, 0, "img_train", mat_row(train));
  set_field(release, 0, "version", mat_text("12"));
  set_field(release, 0, "single_person", mat_cells(std::move(single_person)));
  set_field(release, 0, "act", activities(entries));
  set_field(release, 0, "video_list", mat_cells(std::move(videos)));
  return release;
}

MatValue mpii_keyframes(const std::vector<DemoMpiiEntry>& entries, int key_frame) {
  const std::string file = "/" + numbered(key_frame, 8) + ".jpg";
  MatValue list = mat_struct(entries.size(), {"image"});
  for (std::size_t i = 0; i < entries.size(); ++i) {
    set_field(list, i, "image", image_of(entries[i].name + file));
  }
  return list;
}

}  // namespace eventgan

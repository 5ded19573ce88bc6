#include "stages/synthetic/layouts/detail/mpii_layout_writer.h"

#include <string.h>

#include <algorithm>
#include <array>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"
#include "stages/synthetic/scenes/figure_scene.h"

namespace eventgan {
namespace {

MatValue create(matio_classes kind, matio_types stored, std::size_t rows, std::size_t columns,
                const void* data) {
  std::array<std::size_t, 2> sizes{rows, columns};
  // matio copies the data: its parameter is not const, and not written to.
  MatValue value(Mat_VarCreate(nullptr, kind, stored, 2, sizes.data(), const_cast<void*>(data), 0));
  if (value == nullptr) throw std::bad_alloc();
  return value;
}

struct MatFileCloser {
  void operator()(mat_t* file) const { Mat_Close(file); }
};

}  // namespace

MatValue mat_number(double value) { return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 1, 1, &value); }

MatValue mat_byte(std::uint8_t value) { return create(MAT_C_UINT8, MAT_T_UINT8, 1, 1, &value); }

MatValue mat_text(const std::string& text) {
  return create(MAT_C_CHAR, MAT_T_UINT8, 1, text.size(), text.data());
}

MatValue mat_empty() { return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 0, 0, nullptr); }

MatValue mat_row(const std::vector<double>& values) {
  return create(MAT_C_DOUBLE, MAT_T_DOUBLE, 1, values.size(), values.data());
}

MatValue mat_cells(std::vector<MatValue> column) {
  MatValue cells = create(MAT_C_CELL, MAT_T_CELL, column.size(), 1, nullptr);
  for (std::size_t i = 0; i < column.size(); ++i) {
    Mat_VarSetCell(cells.get(), static_cast<int>(i), column[i].release());
  }
  return cells;
}

MatValue mat_struct(std::size_t count, const std::vector<const char*>& fields, bool column) {
  std::array<std::size_t, 2> sizes{column ? count : 1, column ? 1 : count};
  std::vector<const char*> names = fields;
  MatValue structure(Mat_VarCreateStruct(nullptr, 2, sizes.data(), names.data(),
                                         static_cast<unsigned>(names.size())));
  if (structure == nullptr) throw std::bad_alloc();
  for (std::size_t i = 0; i < count; ++i) {
    for (const char* field : fields) set_field(structure, i, field, mat_empty());
  }
  return structure;
}

void set_field(MatValue& structure, std::size_t index, const char* field, MatValue value) {
  MatValue before(Mat_VarSetStructFieldByName(structure.get(), field, index, value.release()));
}

void write_mat_file(const std::filesystem::path& path, const std::string& name, MatValue value) {
  const std::unique_ptr<mat_t, MatFileCloser> file(
      Mat_CreateVer(path.c_str(), "MATLAB 5.0 MAT-file, eventgan demo dataset", MAT_FT_MAT5));
  if (file == nullptr) throw std::runtime_error("cannot write " + path.string());
  value->name = strdup(name.c_str());  // matio frees it with the value
  if (Mat_VarWrite(file.get(), value.get(), MAT_COMPRESSION_NONE) != 0) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

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

/// The people of a training image. In a test image only where they are and how large.
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

namespace {

constexpr int kImages = 7;
constexpr int kImageOfTwo = 2;  // counted from 0
constexpr int kTestImage = 6;
constexpr int kSequenceFrames = 13;
constexpr int kKeyFrame = 7;  // counted from 1
constexpr Intrinsics kCamera{450, 450, 160, 120};

FigureScene scene_of(std::uint64_t seed, int image) {
  const std::string role = "mpii image " + std::to_string(image);
  std::vector<FigureMotion> figures{cast_figure(seed, role)};
  if (image == kImageOfTwo) {
    // Beside the first and behind it, walking along.
    FigureMotion second = cast_figure(seed, role + " second");
    second.start = figures[0].start + Vector3{figures[0].start.x < 0 ? 800.0 : -800.0, 0, 900};
    second.step = figures[0].step;
    figures.push_back(second);
  }
  return FigureScene(seed + static_cast<std::uint64_t>(image), kCamera, figures);
}

}  // namespace

std::vector<std::string> mpii_layout_names(int sequences) {
  std::vector<std::string> names;
  for (int image = 0; image < std::max(kImages, sequences); ++image) {
    if (image != kTestImage) names.push_back(numbered(image + 1, 9));
  }
  return names;
}

void write_mpii_layout(const std::filesystem::path& root, std::uint64_t seed, int sequences,
                       int intermediate_count, const std::function<void()>& on_image) {
  make_folder(root / "images");
  std::vector<DemoMpiiEntry> entries;
  for (int image = 0; image < std::max(kImages, sequences); ++image) {
    const FigureScene scene = scene_of(seed, image);
    const std::string name = numbered(image + 1, 9);
    const std::filesystem::path sequence = root / "sequences" / name;
    make_folder(sequence);
    for (int number = 1; number <= kSequenceFrames; ++number) {
      write_jpeg(scene.render(number), sequence / (numbered(number, 8) + ".jpg"));
    }
    copy_output(sequence / (numbered(kKeyFrame, 8) + ".jpg"), root / "images" / (name + ".jpg"));
    write_intermediate_frames([&](double frame) { return scene.render(frame); }, kKeyFrame - 1,
                              kKeyFrame + 1, intermediate_count, root / "between" / name);
    entries.push_back({name, image + 1, image != kTestImage, scene.labels(kKeyFrame)});
    on_image();
  }
  write_mat_file(root / "mpii_human_pose_v1_u12_1.mat", "RELEASE", mpii_release(entries));
  write_mat_file(root / "mpii_human_pose_v1_sequences_keyframes.mat", "annolist_keyframes",
                 mpii_keyframes(entries, kKeyFrame));
}

}  // namespace eventgan

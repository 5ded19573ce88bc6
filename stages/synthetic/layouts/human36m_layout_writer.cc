#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/hdf5/hdf5.h"
#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"
#include "stages/synthetic/scenes/figure_scene.h"

namespace eventgan {
namespace {

constexpr int kStoredFrames = 12;  // a camera
constexpr int kFrameStep = 5;      // of the video's numbers, which count from 1

struct Camera {
  int number;
  Intrinsics intrinsics;
  double angle;  ///< around the figure, rad
};
constexpr std::array<Camera, 2> kCameras{
    {{54138969, {451.2, 449.8, 159.4, 120.6}, 0}, {55011271, {447.5, 448.1, 161.3, 118.9}, 1.1}}};
constexpr Vector3 kPivot{0, 0, 4700};

/// The columns of annot.h5, a row for each image.
struct Rows {
  std::vector<double> pose_2d;
  std::vector<double> pose_3d;
  std::vector<std::int64_t> camera;
  std::vector<std::int64_t> frame;
  std::vector<std::int64_t> one;  ///< subject and action: there is one of each

  void add(const FigureLabel& label, int camera_number, int frame_number) {
    for (const Point& joint : label.joints) pose_2d.insert(pose_2d.end(), {joint.x, joint.y});
    for (const Vector3& joint : label.joints3d) {
      pose_3d.insert(pose_3d.end(), {joint.x, joint.y, joint.z});
    }
    camera.push_back(camera_number);
    frame.push_back(frame_number);
    one.push_back(1);
  }
};

/// A table as h36m-fetch has them: in one piece, and here without the time of writing, which would
/// make each file different.
template <class Number>
void write_table(hid_t file, const std::string& name, const Dims& dims,
                 const std::vector<Number>& values) {
  Hdf5Handle table = create_dataset(file, name, element_type<Number>(), space_of(dims, name),
                                    creation_properties(H5P_DATASET_CREATE));
  write_elements(table, name, values);
  table.close(name);
}

void write_annotations(const std::filesystem::path& path, const Rows& rows) {
  const hsize_t count = rows.camera.size();
  const Hdf5Lock lock;
  try {
    Hdf5Handle file(H5Fcreate(path.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT), H5Fclose,
                    "create", "the file");
    create_group(file, "pose").close("pose");
    write_table(file, "pose/2d", {count, kFigureJoints, 2}, rows.pose_2d);
    write_table(file, "pose/3d-univ", {count, kFigureJoints, 3}, rows.pose_3d);
    write_table(file, "camera", {count}, rows.camera);
    write_table(file, "frame", {count}, rows.frame);
    write_table(file, "subject", {count}, rows.one);
    write_table(file, "action", {count}, rows.one);
    create_group(file, "intrinsics").close("intrinsics");
    for (const Camera& camera : kCameras) {
      const Intrinsics& lens = camera.intrinsics;
      write_table(file, "intrinsics/" + std::to_string(camera.number), {4},
                  std::vector<double>{lens.focal_x, lens.centre_x, lens.focal_y, lens.centre_y});
    }
    file.close("the file");
  } catch (const Hdf5Error&) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

}  // namespace

void write_human36m_layout(const std::filesystem::path& root, std::uint64_t seed) {
  const std::filesystem::path action = root / "S1" / "Walking-1";
  const FigureMotion motion = cast_figure(seed, "human36m walking");
  Rows rows;
  for (const Camera& camera : kCameras) {
    const std::filesystem::path folder = action / "imageSequence" / std::to_string(camera.number);
    make_folder(folder);
    const FigureScene scene(seed + static_cast<std::uint64_t>(camera.number), camera.intrinsics,
                            {seen_from(motion, kPivot, camera.angle)});
    for (int stored = 0; stored < kStoredFrames; ++stored) {
      const int number = 1 + kFrameStep * stored;
      write_jpeg(scene.render(stored), folder / ("img_" + numbered(number, 6) + ".jpg"));
      rows.add(scene.labels(stored).front(), camera.number, number);
    }
  }
  write_annotations(action / "annot.h5", rows);
}

}  // namespace eventgan

#include <fmt/core.h>

#include <map>
#include <string>

#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"
#include "stages/synthetic/scenes/road_scene.h"

namespace eventgan {
namespace {

std::string label_line(const RoadLabel& label) {
  const Rectangle& box = label.box;
  const Vehicle& vehicle = label.vehicle;
  if (label.dont_care) {
    return fmt::format(
        "DontCare -1 -1 -10 {:.2f} {:.2f} {:.2f} {:.2f} -1 -1 -1 -1000 -1000 -1000 -10\n", box.left,
        box.top, box.right, box.bottom);
  }
  return fmt::format(
      "{} {:.2f} {} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} "
      "{:.2f}\n",
      vehicle.type, label.truncation, label.occlusion, label.alpha, box.left, box.top, box.right,
      box.bottom, vehicle.height, vehicle.width, vehicle.length, vehicle.location.x,
      vehicle.location.y, vehicle.location.z, vehicle.rotation_y);
}

}  // namespace

std::string kitti_labels(const std::vector<RoadLabel>& labels) {
  std::string text;
  for (const RoadLabel& label : labels) text += label_line(label);
  return text;
}

std::string kitti_calibration(const Intrinsics& camera) {
  std::string text;
  for (const char* name : {"P0", "P1", "P2", "P3"}) {
    text += fmt::format("{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", name,
                        camera.focal_x, camera.centre_x, camera.focal_y, camera.centre_y);
  }
  text += "R0_rect: 1 0 0 0 1 0 0 0 1\n";
  // The laser scanner's x is ahead and its z up; the inertial sensor is in the same place.
  text += "Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";
  return text + "Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n";
}

namespace {

constexpr int kLabelledFrames = 12;
constexpr int kPreviousFrames = 3;
constexpr int kFramesBetween = 2;  // from one labelled frame to the next
constexpr int kFramesOfADrive = 40;

/// Writes images of a scene, each drawn once although it is beside several labelled frames.
class FrameFiles {
 public:
  explicit FrameFiles(const RoadScene& scene) : scene_(scene) {}

  void write(int frame, const std::filesystem::path& path) {
    const auto [written, is_new] = written_.emplace(frame, path);
    if (is_new) {
      write_png(scene_.render(frame), path);
    } else {
      copy_output(written->second, path);
    }
  }

 private:
  const RoadScene& scene_;
  std::map<int, std::filesystem::path> written_;
};

/// A labelled frame with those before it.
void write_frame(const std::filesystem::path& root, int number, const RoadScene& scene, int frame,
                 FrameFiles& files) {
  const std::string name = numbered(number, 6);
  for (int back = kPreviousFrames; back > 0; --back) {
    files.write(frame - back, root / "prev_2" / (name + "_" + numbered(back, 2) + ".png"));
  }
  files.write(frame, root / "image_2" / (name + ".png"));
  write_text(root / "label_2" / (name + ".txt"), kitti_labels(scene.labels(frame)));
  write_text(root / "calib" / (name + ".txt"), kitti_calibration(scene.camera()));
}

}  // namespace

std::vector<std::string> kitti_layout_names(int sequences) {
  std::vector<std::string> names;
  for (int i = 0; i < (sequences > 0 ? sequences : kLabelledFrames); ++i)
    names.push_back(numbered(i, 6));
  return names;
}

void write_kitti_layout(const std::filesystem::path& root, std::uint64_t seed, int sequences,
                        int intermediate_count, const std::function<void()>& on_frame) {
  for (const char* folder : {"image_2", "prev_2", "label_2", "calib"}) make_folder(root / folder);
  if (sequences > 0) {
    for (int i = 0; i < sequences; ++i) {
      const RoadScene scene(seed + static_cast<std::uint64_t>(i));
      FrameFiles files(scene);
      const int labelled = kPreviousFrames + i % kFramesOfADrive;
      write_frame(root, i, scene, labelled, files);
      write_intermediate_frames([&](double frame) { return scene.render(frame); }, labelled - 1,
                                labelled, intermediate_count, root / "between_2" / numbered(i, 6));
      on_frame();
    }
    return;
  }
  const RoadScene scene(seed);
  FrameFiles files(scene);
  for (int i = 0; i < kLabelledFrames; ++i) {
    write_frame(root, i, scene, kPreviousFrames + kFramesBetween * i, files);
    on_frame();
  }
}

}  // namespace eventgan

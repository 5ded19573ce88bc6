#include "stages/scenes/layouts/kitti_layout_writer.h"

#include <map>
#include <string>

#include "stages/scenes/layouts/kitti_text.h"
#include "stages/scenes/layouts/output_files.h"
#include "stages/scenes/road/road_scene.h"

namespace eventgan {
namespace {

constexpr int kLabelledFrames = 12;
constexpr int kPreviousFrames = 3;
constexpr int kFramesBetween = 2;  // from one labelled frame to the next

/// Writes pictures of a scene, each drawn once although it stands beside several labelled frames.
class FrameFiles {
 public:
  explicit FrameFiles(const RoadScene& scene) : scene_(scene) {}

  void write(int frame, const std::filesystem::path& path) {
    const auto [written, is_new] = written_.emplace(frame, path);
    if (is_new) {
      write_png(scene_.picture(frame), path);
    } else {
      copy_output(written->second, path);
    }
  }

 private:
  const RoadScene& scene_;
  std::map<int, std::filesystem::path> written_;
};

}  // namespace

void write_kitti_layout(const std::filesystem::path& root, std::uint64_t seed) {
  for (const char* folder : {"image_2", "prev_2", "label_2", "calib"}) make_folder(root / folder);
  const RoadScene scene(seed);
  FrameFiles files(scene);
  for (int i = 0; i < kLabelledFrames; ++i) {
    const std::string name = numbered(i, 6);
    const int frame = kPreviousFrames + kFramesBetween * i;
    for (int back = kPreviousFrames; back > 0; --back) {
      files.write(frame - back, root / "prev_2" / (name + "_" + numbered(back, 2) + ".png"));
    }
    files.write(frame, root / "image_2" / (name + ".png"));
    write_text(root / "label_2" / (name + ".txt"), kitti_labels(scene.labels(frame)));
    write_text(root / "calib" / (name + ".txt"), kitti_calibration(scene.camera()));
  }
}

}  // namespace eventgan

#include "stages/scenes/layouts/mpii_layout_writer.h"

#include <string>
#include <vector>

#include "stages/scenes/figure/figure_casting.h"
#include "stages/scenes/figure/figure_scene.h"
#include "stages/scenes/layouts/mpii_annotation_internal.h"
#include "stages/scenes/layouts/output_files.h"

namespace eventgan {
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

void write_mpii_layout(const std::filesystem::path& root, std::uint64_t seed) {
  make_folder(root / "images");
  std::vector<DemoMpiiEntry> entries;
  for (int image = 0; image < kImages; ++image) {
    const FigureScene scene = scene_of(seed, image);
    const std::string name = numbered(image + 1, 9);
    const std::filesystem::path sequence = root / "sequences" / name;
    make_folder(sequence);
    for (int number = 1; number <= kSequenceFrames; ++number) {
      write_jpeg(scene.picture(number), sequence / (numbered(number, 8) + ".jpg"));
    }
    copy_output(sequence / (numbered(kKeyFrame, 8) + ".jpg"), root / "images" / (name + ".jpg"));
    entries.push_back({name, image + 1, image != kTestImage, scene.labels(kKeyFrame)});
  }
  write_mat_file(root / "mpii_human_pose_v1_u12_1.mat", "RELEASE", mpii_release(entries));
  write_mat_file(root / "mpii_human_pose_v1_sequences_keyframes.mat", "annolist_keyframes",
                 mpii_keyframes(entries, kKeyFrame));
}

}  // namespace eventgan

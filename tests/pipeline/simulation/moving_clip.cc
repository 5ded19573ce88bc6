#include "tests/pipeline/simulation/moving_clip.h"

#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "manifests/documents/simulation_manifest.h"
#include "manifests/values/counter_random.h"

namespace eventgan::testing {
namespace {

constexpr int kStep_px = 2;

int texture(int x, int y) {
  return static_cast<int>(
      CounterRandom(1).below(static_cast<std::uint64_t>(y / 3 * 97 + x / 3), 60));
}

}  // namespace

void write_moving_clip(const std::filesystem::path& folder, ImageSize size, int frames) {
  std::filesystem::create_directories(folder);
  const int side = size.height / 2;
  for (int frame = 0; frame < frames; ++frame) {
    cv::Mat image(size.height, size.width, CV_8UC1);
    const int left = 4 + kStep_px * frame;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const bool inside = x >= left && x < left + side && y >= side / 2 && y < side / 2 + side;
        const int value = inside ? 160 + texture(x - left, y) : 30 + texture(x + 500, y);
        image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
      }
    }
    char name[16];
    std::snprintf(name, sizeof name, "%03d.png", frame);
    if (!cv::imwrite((folder / name).string(), image)) {
      throw std::runtime_error("cannot write an image in " + folder.string());
    }
  }
}

SimulationManifest moving_clip_manifest(const std::filesystem::path& folder,
                                        const std::string& sources, const std::string& more) {
  return parse_simulation_manifest(
      R"({"format": "eventgan-simulation", "version": 1, "name": "s", "sources": [)" + sources +
          R"(], "output": {"directory": "out"})" + more + "}",
      folder, "s.json");
}

}  // namespace eventgan::testing

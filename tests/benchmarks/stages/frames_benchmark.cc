// From an image's file to the generator's input, step by step, on images of KITTI's size made
// here: smooth shades, edges and sensor noise, so that they compress about as photographs do.
// Bytes per second are of what the step reads: the file, the colour image, the grey one.
//   build/release/tests/eventgan_frames_benchmark

#include <benchmark/benchmark.h>

#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

constexpr int kFrames = 24;

/// A street seen by a camera that moves on: frame by frame a little further to the left.
cv::Mat street(int frame) {
  const cv::Size size(1242, 375);
  cv::Mat image(size, CV_8UC3);
  for (int y = 0; y < size.height; ++y) {  // sky to road
    image.row(y).setTo(cv::Scalar(200 - y / 3, 170 - y / 4, 150 - y / 4));
  }
  cv::RNG houses(7);
  for (int i = 0; i < 150; ++i) {
    const cv::Point corner(houses.uniform(-50, 1600) - 6 * frame, houses.uniform(60, 330));
    const cv::Size side(houses.uniform(5, 120), houses.uniform(5, 60));
    const cv::Scalar shade(houses.uniform(20, 230), houses.uniform(20, 230),
                           houses.uniform(20, 230));
    cv::rectangle(image, cv::Rect(corner, side), shade, cv::FILLED);
  }
  cv::GaussianBlur(image, image, cv::Size(3, 3), 0);
  cv::Mat noise(size, CV_16SC3);
  cv::RNG sensor(static_cast<std::uint64_t>(frame) + 1);
  sensor.fill(noise, cv::RNG::NORMAL, 0, 2);
  cv::add(image, noise, image, cv::noArray(), CV_8U);
  return image;
}

/// A drive in one format, written once.
class Drive {
 public:
  explicit Drive(const std::string& format) : format_(format) {
    for (int frame = 0; frame < kFrames; ++frame) {
      cv::imwrite((folder_ / name(frame)).string(), street(frame));
    }
  }
  std::string name(int frame) const { return std::to_string(frame) + format_; }
  std::filesystem::path path(int frame) const { return folder_ / name(frame); }
  std::filesystem::path folder() const { return folder_.path(); }

  /// Of two frames next to each other.
  FramePair pair(int next) const {
    FramePair pair;
    pair.previous.path = name(next - 1);
    pair.next.path = name(next);
    return pair;
  }

 private:
  testing::TemporaryFolder folder_;
  std::string format_;
};

const Drive& png_drive() {
  static const Drive drive(".png");
  return drive;
}

const Drive& jpeg_drive() {
  static const Drive drive(".jpg");
  return drive;
}

ImageSpec kitti_spec() {
  ImageSpec spec;
  spec.size = ImageSize{260, 861};
  spec.blur = 3;
  return spec;
}

void decode(benchmark::State& state, const Drive& drive) {
  std::int64_t bytes = 0;
  for (int frame = 0; auto _ : state) {
    benchmark::DoNotOptimize(decode_image_file(drive.path(frame)));
    bytes += static_cast<std::int64_t>(std::filesystem::file_size(drive.path(frame)));
    frame = (frame + 1) % kFrames;
  }
  state.SetBytesProcessed(bytes);
  state.SetItemsProcessed(state.iterations());
}

void decode_png_image(benchmark::State& state) { decode(state, png_drive()); }
void decode_jpeg_image(benchmark::State& state) { decode(state, jpeg_drive()); }

/// For comparison: what OpenCV takes, which forgives damage.
void opencv_decodes_png(benchmark::State& state) {
  for (int frame = 0; auto _ : state) {
    benchmark::DoNotOptimize(cv::imread(png_drive().path(frame).string()));
    frame = (frame + 1) % kFrames;
  }
  state.SetItemsProcessed(state.iterations());
}

void prepare(benchmark::State& state) {
  const cv::Mat image = street(0);
  const ColourView view{{image.rows, image.cols}, image.data};
  ImageSpec spec = kitti_spec();
  spec.grey = state.range(0) == 0 ? GreyOrder::kBeforeResize : GreyOrder::kAfterResize;
  for (auto _ : state) benchmark::DoNotOptimize(prepare_frame(view, spec));
  state.SetBytesProcessed(static_cast<std::int64_t>(3 * view.size.pixel_count()) *
                          state.iterations());
  state.SetItemsProcessed(state.iterations());
}

/// A still's pair of 320x192 with three objects, without and with its optical flow. Items are
/// pairs.
void still_pair(benchmark::State& state) {
  const cv::Mat street_view = street(0);
  const auto image = std::make_shared<const ColourFrame>(ColourFrame{
      {street_view.rows, street_view.cols}, {street_view.datastart, street_view.dataend}});
  ImageSpec spec;
  spec.size = ImageSize{192, 320};
  FramePair pair;
  pair.motion = {.x_px = 3, .y_px = -1, .angle_deg = 1, .scale = 1.01};
  std::vector<Box> boxes;
  for (const double left : {100.0, 500.0, 900.0}) {
    const double top = 120, right = left + 200, bottom = 330;
    boxes.push_back({.class_id = 0,
                     .xyxy = {left, top, right, bottom},
                     .outline = {{{{left, top}, {right, top}, {right, bottom}, {left, bottom}}}}});
    pair.objects.push_back(ImageMotion{.x_px = left / 100});
  }
  for (auto _ : state) {
    const MovingStill still(image, pair, spec, boxes);
    const FramesBetween frames = still.frames(pair);
    for (const int end : {0, 1}) benchmark::DoNotOptimize(frames.at(end));
    if (state.range(0)) benchmark::DoNotOptimize(still.flow(pair));
  }
  state.SetItemsProcessed(state.iterations());
}

void grey_to_input(benchmark::State& state) {
  const PreparedFrame frame = [] {
    const cv::Mat image = street(0);
    return prepare_frame({{image.rows, image.cols}, image.data}, kitti_spec());
  }();
  std::vector<float> input(frame.grey.size());
  for (auto _ : state) {
    to_input(frame.grey, input);
    benchmark::DoNotOptimize(input.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(frame.grey.size()) * state.iterations());
  state.SetItemsProcessed(state.iterations());
}

/// All pairs of neighbours of the drive, in the plan's order. Items are pairs. Argument: whether
/// one reader reads them all, so that each frame is decoded once.
void read_pairs(benchmark::State& state, const Drive& drive) {
  const bool sharing = state.range(0) != 0;
  for (auto _ : state) {
    PairReader shared(drive.folder(), kitti_spec());
    for (int next = 1; next < kFrames; ++next) {
      const auto outcome = sharing
                               ? shared.read(drive.pair(next))
                               : PairReader(drive.folder(), kitti_spec()).read(drive.pair(next));
      if (is_fault(outcome)) throw std::runtime_error(outcome.fault().reason);
    }
  }
  state.SetItemsProcessed((kFrames - 1) * state.iterations());
}

void read_png_pairs(benchmark::State& state) { read_pairs(state, png_drive()); }
void read_jpeg_pairs(benchmark::State& state) { read_pairs(state, jpeg_drive()); }

BENCHMARK(decode_png_image)->Unit(benchmark::kMillisecond);
BENCHMARK(opencv_decodes_png)->Unit(benchmark::kMillisecond);
BENCHMARK(decode_jpeg_image)->Unit(benchmark::kMillisecond);
BENCHMARK(prepare)->ArgName("grey_last")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(still_pair)->ArgName("flow")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(grey_to_input)->Unit(benchmark::kMillisecond);
BENCHMARK(read_png_pairs)->ArgName("sharing")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(read_jpeg_pairs)->ArgName("sharing")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eventgan

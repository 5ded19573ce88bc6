// How well objects are cut out of their boxes, and how long one takes, by the side of the reduced
// copy, GrabCut's iterations and the core's width (CutOutSpec): IoU with the outlines that people
// drew, of what is cut and of the ellipse in the box alone, and the share that became ellipses.
// Of photographs kept beside the checkout (tests/testing/shared_data.h); without them nothing runs.
//   build/release/tests/eventgan_cut_out_benchmark

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "manifests/values/outlines.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/cut_out.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

struct OutlinedImage {
  ColourFrame image;
  std::vector<Box> boxes;  ///< with outlines, in the image's pixels
};

/// Every third image of a dataset whose labels have outlines.
std::vector<OutlinedImage> read_images(SourceSpec spec, const std::filesystem::path& folder) {
  std::vector<OutlinedImage> images;
  const auto dataset = open_dataset(spec, folder);
  for (std::size_t i = 0; i < dataset->labelled_frames().size(); i += 3) {
    const LabelledFrame& frame = dataset->labelled_frames()[i];
    OutlinedImage read{decode_image_file(folder / frame.frame.path), {}};
    const Outcome<Annotation> annotation = dataset->annotation(frame.label_key);
    for (const Box& box : annotation->boxes) {
      if (!box.ignore && !box.outline.empty()) read.boxes.push_back(box);
    }
    images.push_back(std::move(read));
  }
  return images;
}

const std::vector<OutlinedImage>& images_of(const std::string& name) {
  static std::map<std::string, std::vector<OutlinedImage>> read;
  std::vector<OutlinedImage>& images = read[name];
  if (!images.empty()) return images;
  SourceSpec spec;
  spec.root = "images";
  if (name == "coco256") {
    spec.labels = LabelSpec{LabelFormat::kCoco, "instances.json"};
  } else {
    spec.labels = LabelSpec{LabelFormat::kCsv, "boxes.csv"};
    spec.outlines = "masks";
  }
  return images = read_images(spec, testing::shared_data() / "labelled_frames" / name);
}

double iou(const GreyImage& a, const GreyImage& b) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    both += a.pixels[i] && b.pixels[i];
    either += a.pixels[i] || b.pixels[i];
  }
  return either > 0 ? both / either : 0;
}

/// Without a core of any width all is cut badly.
CutOutSpec ellipses_alone() { return {.side_px = 1}; }

void cut(benchmark::State& state, const std::string& name, const CutOutSpec& spec) {
  const std::vector<OutlinedImage>& images = images_of(name);
  double sum = 0, count = 0, ellipses = 0;
  for (auto _ : state) {
    for (const OutlinedImage& image : images) {
      for (const Box& box : image.boxes) {
        const CutOut found = cut_out({image.image.size, image.image.bgr.data()}, box.xyxy, spec);
        state.PauseTiming();
        sum +=
            iou(mask_of(found.outline, image.image.size), mask_of(box.outline, image.image.size));
        ellipses += found.is_ellipse;
        ++count;
        state.ResumeTiming();
      }
    }
  }
  state.counters["objects"] = count / static_cast<double>(state.iterations());
  state.counters["iou"] = sum / count;
  state.counters["ellipses"] = ellipses / count;
  state.counters["s_per_object"] =
      benchmark::Counter(count, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void add(const std::string& name, const std::string& what, const CutOutSpec& spec) {
  benchmark::RegisterBenchmark((name + "/" + what).c_str(), cut, name, spec)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

const bool kAdded = [] {
  if (testing::shared_data().empty()) return false;
  for (const std::string name : {"coco256", "pennfudan"}) {
    add(name, "ellipse", ellipses_alone());
    for (const int side : {32, 48, 64, 96, 160, 320}) {
      for (const int iterations : {1, 3}) {
        add(name, std::to_string(side) + "px/" + std::to_string(iterations) + "x",
            {.side_px = side, .iterations = iterations});
      }
    }
    for (const double core : {0.1, 0.3, 0.5, 0.9}) {
      add(name, "core" + std::to_string(core).substr(0, 3), {.core = core});
    }
  }
  return true;
}();

}  // namespace
}  // namespace eventgan

#include "pipeline/simulation/still_scenes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/simulation/simulate.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/recordings/readers/recording.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

constexpr int kFrames = 6;
constexpr double kRate_hz = 20;

/// Photographs of 128x96 of a bright square of 24 px on dark noise, with its outline; the camera
/// rests, and the square moves by 3 px a frame.
class StillScenesTest : public ::testing::Test {
 protected:
  StillScenesTest() {
    std::filesystem::create_directories(folder_ / "photos");
    add_photo("a", 50, 40);
    add_photo("b", 40, 30);
    write_job();
  }

  void add_photo(const std::string& name, int left, int top) {
    cv::Mat image(96, 128, CV_8UC1);
    cv::RNG random(3);
    random.fill(image, cv::RNG::UNIFORM, 20, 50);
    image(cv::Rect(left, top, 24, 24)) = 220;
    cv::imwrite((folder_ / "photos" / (name + ".png")).string(), image);
    const auto number = [](int value) { return std::to_string(value); };
    const std::string id = number(++photos_), x = number(left), y = number(top),
                      right = number(left + 24), bottom = number(top + 24);
    images_ += (photos_ > 1 ? "," : "") + (R"({"id": )" + id) + R"(, "file_name": ")" + name +
               R"(.png", "width": 128, "height": 96})";
    objects_ += (photos_ > 1 ? "," : "") + (R"({"id": )" + id) + R"(, "image_id": )" + id +
                R"(, "category_id": 1, "iscrowd": 0, "bbox": [)" + x + "," + y +
                R"(,24,24], "segmentation": [[)" + x + "," + y + "," + right + "," + y + "," +
                right + "," + bottom + "," + x + "," + bottom + "]]}";
    testing::write_file(folder_ / "coco.json",
                        R"({"images": [)" + images_ + R"(], "annotations": [)" + objects_ +
                            R"(], "categories": [{"id": 1, "name": "box"}]})");
  }

  void write_job(const std::string& pairs = R"("frames": 6)", const std::string& seed = "5",
                 const std::string& rate = "20") {
    testing::write_file(folder_ / "job.json", R"({
      "format": "eventgan-manifest", "version": 1, "name": "job", "seed": )" +
                                                  seed + R"(,
      "sources": [{"dataset": "frames", "root": "photos",
        "labels": {"format": "coco", "path": "coco.json"}, "frames_per_second": )" +
                                                  rate + R"(,
        "pairs": {"from": "stills", )" + pairs + R"(,
          "motion": {"translation_px": [1, 2], "rotation_deg": 0, "scale": 0, "rests": 1,
                     "objects": {"translation_px": [3, 3], "rotation_deg": 0, "scale": 0}}}}],
      "image": {"preset": "mpii"}, "generator": {"kind": "difference"},
      "output": {"directory": "out"},
      "errors": {"policy": "quarantine", "max_count": 0, "max_fraction": 0}})");
  }

  SimulationManifest manifest(const std::string& more = "") const {
    return testing::moving_clip_manifest(
        folder_.path(), R"({"path": "job.json", "method": "stills", "name": "s"})", more);
  }

  SimulationReport run(const std::string& output, int threads = 1, const std::string& more = "",
                       SimulatedFile file = SimulatedFile::kHdf5, bool overwrite = false) {
    SimulationOptions options;
    options.output = folder_ / output;
    options.threads = threads;
    options.overwrite = overwrite;
    SimulationManifest simulation = manifest(more);
    simulation.file = file;
    return simulate(simulation, options);
  }

  std::map<std::string, std::string> files(const std::string& output) const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / output)) {
      bytes[entry.path().filename()] = testing::read_file(entry.path());
    }
    return bytes;
  }

  testing::TemporaryFolder folder_;

 private:
  int photos_ = 0;
  std::string images_, objects_;
};

/// Where an image is brighter than half of the square's light.
Rectangle bright(ImageSize size, const std::function<double(std::size_t)>& level) {
  Rectangle around{1e9, 1e9, -1, -1};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (level(static_cast<std::size_t>(y * size.width + x)) < 130) continue;
      around = {std::min(around.left, double(x)), std::min(around.top, double(y)),
                std::max(around.right, x + 1.0), std::max(around.bottom, y + 1.0)};
    }
  }
  return around;
}

TEST_F(StillScenesTest, EachIsARecordingWhoseLabelsAreWhereItsFramesShowThem) {
  for (const std::string side : {"before", "after"}) {
    for (const std::string size : {"", R"(, "size": {"width": 48, "height": 40})"}) {
      SCOPED_TRACE(side + size);
      write_job(R"("frames": 6, "side": ")" + side + '"');
      const std::string out = "out-" + side + std::to_string(size.size());
      const SimulationReport report = run(out, 2, size);
      ASSERT_EQ(report.made.size(), 2u);
      for (const char* name : {"s-000", "s-001"}) {
        const auto recording =
            open_recording(folder_ / out / (name + std::string(".hdf5")), RecordingFormat::kMvsec);
        ASSERT_EQ(recording->frame_count(), kFrames);
        const RecordingLabels labels =
            read_recording_labels(folder_ / out / (name + std::string(".json")));
        EXPECT_THAT(labels.class_names, ElementsAre("box"));
        EXPECT_EQ(std::ssize(labels.annotations), kFrames - 1);
        std::vector<Rectangle> boxes(kFrames);
        for (const auto& [time_s, annotation] : labels.annotations) {
          const auto k = std::lround(time_s * kRate_hz);
          EXPECT_DOUBLE_EQ(recording->frame_time_s(k), time_s);
          ASSERT_EQ(annotation.boxes.size(), 1u);
          const Box& box = annotation.boxes[0];
          EXPECT_EQ(box.track_id, 0);
          boxes[static_cast<std::size_t>(k)] = box.xyxy;
          const GreyImage frame = recording->frame(k);
          const Rectangle seen = bright(frame.size, [&](auto i) { return frame.pixels[i]; });
          EXPECT_NEAR(box.xyxy.left, seen.left, 1.5);
          EXPECT_NEAR(box.xyxy.top, seen.top, 1.5);
          EXPECT_NEAR(box.xyxy.right, seen.right, 1.5);
          EXPECT_NEAR(box.xyxy.bottom, seen.bottom, 1.5);
        }
        const int first = side == "before" ? 1 : 0;
        for (int k = first; k + 1 < first + kFrames - 1; ++k) {
          const Rectangle &from = boxes[static_cast<std::size_t>(k)],
                          &to = boxes[static_cast<std::size_t>(k) + 1];
          const GreyImage frame = recording->frame(k);
          const auto flow = recording->flow(k).value();
          const auto at = [&](double x, double y) {
            return static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.size.width) +
                   static_cast<std::size_t>(x);
          };
          const auto middle = at((from.left + from.right) / 2, (from.top + from.bottom) / 2);
          EXPECT_NEAR(flow.x_px[middle], to.left - from.left, 1.1);
          EXPECT_NEAR(flow.y_px[middle], to.top - from.top, 1.1);
          EXPECT_EQ(flow.x_px[at(0, 0)], 0) << "the camera rests";
          const auto events = recording->events_between(k, k + 1);
          EXPECT_GT(events.size(), 10u);
          for (const Event& event : events) {
            EXPECT_GE(event.x, std::min(from.left, to.left) - 3);
            EXPECT_LE(event.x, std::max(from.right, to.right) + 3);
          }
        }
      }
    }
  }
}

TEST_F(StillScenesTest, BetweenItsFramesThingsMove) {
  const SimulationManifest simulation = manifest();
  const StillScenes scenes(simulation.sources[0], simulation);
  ASSERT_EQ(scenes.count(), 2);
  EXPECT_EQ(scenes.frame_count(0), kFrames);
  const auto scene = scenes.scene(0);
  EXPECT_EQ(scene->time_s(), 0);
  const auto interval = scene->advance();
  EXPECT_DOUBLE_EQ(scene->time_s(), 0.05);
  ASSERT_GE(interval->steps(), 3);
  const auto place = [&](int step) {
    const auto image = interval->render(step);
    return bright(interval->size(), [&](auto i) { return 255 * image[i]; });
  };
  const Rectangle from = place(0), to = place(interval->steps());
  double farthest = 0;
  for (int step = 0; step <= interval->steps(); ++step) {
    const double u = double(step) / interval->steps();
    const Rectangle at = place(step);
    EXPECT_NEAR(at.left, from.left + u * (to.left - from.left), 1);
    EXPECT_NEAR(at.top, from.top + u * (to.top - from.top), 1);
    EXPECT_NEAR(at.right - at.left, 24, 1) << "a blend would be wider";
    farthest = std::max(farthest, std::abs(at.left - from.left) + std::abs(at.top - from.top));
  }
  EXPECT_GE(farthest, 2);
  const GreyImage end = scene->frame();
  const auto last = interval->render(interval->steps());
  for (std::size_t i = 0; i < last.size(); ++i)
    ASSERT_EQ(std::lround(255 * last[i]), end.pixels[i]);
}

TEST_F(StillScenesTest, ThreadsDoNotChangeBytes) {
  run("one", 1);
  run("four", 4);
  EXPECT_EQ(files("one").size(), 4u);
  EXPECT_EQ(files("one"), files("four"));
}

TEST_F(StillScenesTest, AnotherPhotographLeavesTheFirstOnesAndAnotherSeedDoesNot) {
  run("out");
  const auto before = files("out");
  add_photo("c", 45, 35);
  const SimulationReport report = run("out");
  EXPECT_THAT(report.kept, ElementsAre("s-000", "s-001"));
  ASSERT_EQ(report.made.size(), 1u);
  EXPECT_EQ(report.made[0].name, "s-002");
  EXPECT_EQ(files("out").at("s-000.hdf5"), before.at("s-000.hdf5"));
  write_job(R"("frames": 6)", "6");
  EXPECT_THROWS(run("out"), UsageError, "was made by a run that");
}

TEST_F(StillScenesTest, TheStillThatIsNotInterpolatedIsNoFrame) {
  const SimulationManifest simulation = manifest();
  const auto scene = StillScenes(simulation.sources[0], simulation).scene(0);
  const cv::Mat still = cv::imread((folder_ / "photos/a.png").string(),
                                   cv::IMREAD_GRAYSCALE)(cv::Rect(16, 12, 96, 72));
  const auto& frame = scene->frame();
  ASSERT_EQ(frame.size, (ImageSize{72, 96}));
  EXPECT_NE(cv::norm(cv::Mat(72, 96, CV_8UC1, const_cast<std::uint8_t*>(frame.pixels.data())),
                     still, cv::NORM_INF),
            0);
}

TEST_F(StillScenesTest, ARenamedClassMakesOthersAndAnotherSourceDoesNot) {
  const SimulationManifest simulation = manifest();
  const auto hash = [&](std::int64_t position) {
    return StillScenes(simulation.sources[0], simulation).hash(position);
  };
  const auto replace = [&](const char* file, const std::string& from, const std::string& to) {
    std::string text = testing::read_file(folder_ / file);
    text.replace(text.find(from), from.size(), to);
    testing::write_file(folder_ / file, text);
  };
  const std::string before = hash(0);
  std::filesystem::copy(folder_ / "coco.json", folder_ / "other.json");
  replace("other.json", R"("name": "box")", R"("name": "other")");  // is class 0 now
  replace("job.json", R"("sources": [)",
          R"("sources": [{"dataset": "frames", "root": "photos", "split": "val",
                          "labels": {"format": "coco", "path": "other.json"},
                          "pairs": {"from": "stills", "frames": 6,
                                    "motion": {"translation_px": [1, 2]}}},)");
  EXPECT_EQ(hash(2), before);
  replace("coco.json", R"("name": "box")", R"("name": "crate")");
  EXPECT_NE(hash(2), before);
}

TEST_F(StillScenesTest, LabelsOfOthersAreNotReplaced) {
  testing::write_file(folder_ / "out/s-000.json", "mine");
  EXPECT_THROWS(run("out"), UsageError, "s-000.json");
  EXPECT_EQ(files("out").at("s-000.json"), "mine");
  EXPECT_FALSE(files("out").contains("s-000.hdf5"));
}

TEST_F(StillScenesTest, OtherLabelsAreReplacedIfThatIsAskedForOnly) {
  run("out");
  const auto first = files("out");
  run("out", 1, "", SimulatedFile::kAedat4);  // of the same labels
  EXPECT_EQ(files("out").size(), 6u);
  const std::string smaller = R"(, "size": {"width": 48, "height": 40})";
  const auto run_smaller = [&](bool overwrite) {
    run("out", 1, smaller, SimulatedFile::kRaw, overwrite);
  };
  EXPECT_THROWS(run_smaller(false), UsageError, "s-000.json");
  EXPECT_EQ(files("out").size(), 6u) << "nothing was made";
  EXPECT_EQ(files("out").at("s-000.json"), first.at("s-000.json"));
  run_smaller(true);
  EXPECT_EQ(files("out").size(), 8u);
  EXPECT_NE(files("out").at("s-000.json"), first.at("s-000.json"));
}

TEST_F(StillScenesTest, LabelsThatAreGoneAreWrittenAgain) {
  run("out");
  const auto before = files("out");
  std::filesystem::remove(folder_ / "out/s-000.json");
  EXPECT_EQ(run("out").kept.size(), 2u);
  EXPECT_EQ(files("out"), before);
}

TEST_F(StillScenesTest, WhatCannotBeMadeAgainIsKeptWithItsLabels) {
  run("out");
  const auto before = files("out");
  write_job(R"("frames": 6)", "5", "1e-6");
  const std::string noise = R"(, "sensor": {"shot_noise_rate_hz": 1e5})";  // fits no memory
  EXPECT_THROWS(run("out", 1, noise, SimulatedFile::kHdf5, true), std::exception,
                "expected a sensor whose events fit into memory");
  EXPECT_EQ(files("out"), before);
}

TEST_F(StillScenesTest, RefusesAJobWithoutClipsAndAPhotographThatCannotBeRead) {
  testing::write_file(folder_ / "photos/a.png", "no image");
  EXPECT_THROWS(run("out"), InputError, "a.png");
  EXPECT_FALSE(files("out").contains("s-000.hdf5"));
  EXPECT_TRUE(files("out").contains("s-001.hdf5")) << "the other is made";
  write_job(R"("side": "before")");
  EXPECT_THROWS(run("out"), InputError, "got 0 of 0");
}

}  // namespace
}  // namespace eventgan

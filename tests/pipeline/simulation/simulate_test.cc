#include "pipeline/simulation/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "pipeline/simulation/scene.h"
#include "stages/recordings/readers/recording.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// A bright half-plane that moves 2 px to the right in each of two intervals.
AffineScene moving_edge() {
  const ImageSize size{8, 32};
  GreyImage image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) image.pixels.push_back(x < 16 ? 200 : 50);
  }
  AffineMotion motion;
  motion.matrix = {1, 0, 6, 0, 1, 0};
  return AffineScene(image, motion, 3, 0.1);
}

SensorSpec quiet_sensor() {
  SensorSpec spec;
  spec.threshold_spread = 0;
  return spec;
}

TEST(Record, WritesFramesEventsAndFlows) {
  const testing::TemporaryFolder folder;
  AffineScene scene = moving_edge();
  const GreyImage first = scene.frame();
  int shown = 0;
  const RecordingSummary summary =
      record(scene, quiet_sensor(), CounterRandom(1), folder / "edge.hdf5", "{}", [&] { ++shown; });
  EXPECT_EQ(summary.name, "edge");
  EXPECT_EQ(summary.frames, 3);
  EXPECT_EQ(shown, 3);
  EXPECT_DOUBLE_EQ(summary.duration_s, 0.2);
  EXPECT_EQ(summary.pixels, 8 * 32);
  EXPECT_NEAR(summary.displacement_px, 2, 1e-5);
  // Four columns turn bright: ln((200 + 0.255)/(50 + 0.255)) = 1.382, six thresholds of 0.2 each.
  EXPECT_EQ(summary.events, 8 * 4 * 6);

  const auto recording = open_recording(folder / "edge.hdf5", RecordingFormat::kMvsec);
  EXPECT_EQ(recording->frame_count(), 3);
  EXPECT_EQ(recording->frame(0), first);
  EXPECT_EQ(recording->frame(2), scene.frame());
  EXPECT_DOUBLE_EQ(recording->frame_time_s(2), 0.2);
  const std::vector<Event> events = recording->events_between(0, 1);
  EXPECT_EQ(events.size(), 8u * 2 * 6);
  for (const Event& event : events) {
    EXPECT_TRUE(event.positive);
    EXPECT_GE(event.x, 18);  // the first frame has moved 2 px already
    EXPECT_LE(event.x, 19);
    EXPECT_GT(event.t_s, 0);
    EXPECT_LE(event.t_s, 0.1);
  }
  EXPECT_NEAR(recording->flow(1).value().x_px.at(0), 2, 1e-5);
}

TEST(Record, RefusesNoiseThatDoesNotFitIntoMemory) {
  const testing::TemporaryFolder folder;
  AffineScene scene(GreyImage{{2, 2}, {1, 2, 3, 4}}, {}, 2, 1e9);  // 1e9 s between its frames
  SensorSpec spec = quiet_sensor();
  spec.shot_noise_rate_hz = 1e6;
  EXPECT_THROWS(record(scene, spec, CounterRandom(1), folder / "a.hdf5", "{}", [] {}),
                std::runtime_error, "about 4e+15 events");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Record, LeavesNothingIfTheSceneFails) {
  class BrokenScene final : public Scene {
   public:
    const GreyImage& frame() const override { return frame_; }
    double time_s() const override { return 0; }
    std::unique_ptr<Interval> advance() override { throw std::runtime_error("broken"); }
    bool has_flow() const override { return false; }

   private:
    GreyImage frame_{{2, 2}, {1, 2, 3, 4}};
  } scene;
  const testing::TemporaryFolder folder;
  EXPECT_THROWS(record(scene, {}, CounterRandom(1), folder / "a.hdf5", "{}", [] {}),
                std::runtime_error, "broken");
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

const std::string kSources = R"(
  {"path": "clip"}, {"path": "clip", "name": "fade", "method": "difference"},
  {"path": "clip", "name": "still", "method": "affine", "frame_count": 2, "frames_per_image": 3})";

class Simulate : public ::testing::Test {
 protected:
  Simulate() { testing::write_moving_clip(folder_ / "clip", {32, 48}, 4); }

  SimulationReport run(const std::string& output, int threads = 1, bool overwrite = false,
                       const std::string& sources = kSources, const std::string& more = "") {
    SimulationOptions options;
    options.output = folder_ / output;
    options.threads = threads;
    options.overwrite = overwrite;
    return simulate(testing::moving_clip_manifest(folder_.path(), sources, more), options);
  }

  std::map<std::string, std::string> files(const std::string& output) const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / output)) {
      bytes[entry.path().filename()] = testing::read_file(entry.path());
    }
    return bytes;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(Simulate, MakesEveryRecording) {
  const SimulationReport report = run("out");
  std::vector<std::string> names;
  for (const RecordingSummary& recording : report.made) {
    names.push_back(recording.name);
    EXPECT_GT(recording.events, 0) << recording.name;
  }
  EXPECT_THAT(names, ::testing::ElementsAre("clip", "fade", "still-000", "still-001"));
  EXPECT_TRUE(report.kept.empty());
  EXPECT_EQ(report.made[0].frames, 4);
  EXPECT_EQ(report.made[2].frames, 3);
  const auto clip = open_recording(folder_ / "out/clip.hdf5", RecordingFormat::kMvsec);
  EXPECT_TRUE(clip->flow(0).has_value());
  EXPECT_DOUBLE_EQ(clip->frame_time_s(3), 0.1);
  const auto fade = open_recording(folder_ / "out/fade.hdf5", RecordingFormat::kMvsec);
  EXPECT_FALSE(fade->flow(0).has_value());
}

// Times are rounded to microseconds.
TEST_F(Simulate, WritesTheSameRecordingsForDvAndMetavision) {
  run("out");
  SimulationManifest manifest = testing::moving_clip_manifest(folder_.path(), kSources);
  SimulationOptions options;
  options.output = folder_ / "out";
  for (const SimulatedFile file : {SimulatedFile::kAedat4, SimulatedFile::kRaw}) {
    manifest.file = file;
    EXPECT_EQ(simulate(manifest, options).made.size(), 4u);
    EXPECT_EQ(simulate(manifest, options).kept.size(), 4u);
    for (const std::string name : {"clip", "fade", "still-000", "still-001"}) {
      const auto mvsec =
          open_recording(folder_ / "out" / (name + ".hdf5"), RecordingFormat::kMvsec);
      const std::filesystem::path path =
          folder_ / "out" / (name + "." + std::string(to_string(file)));
      const bool has_frames = file == SimulatedFile::kAedat4;
      const auto recording =
          open_recording(path, has_frames ? RecordingFormat::kAedat4 : RecordingFormat::kProphesee);
      const auto expected = mvsec->events_in(-1, 10), found = recording->events_in(-1, 10);
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_NEAR(found[i].t_s, expected[i].t_s, 0.51e-6);
        EXPECT_TRUE(found[i].x == expected[i].x && found[i].y == expected[i].y &&
                    found[i].positive == expected[i].positive);
      }
      ASSERT_EQ(recording->frame_count(), has_frames ? mvsec->frame_count() : 0);
      for (std::int64_t i = 0; i < recording->frame_count(); ++i) {
        EXPECT_EQ(recording->frame(i), mvsec->frame(i));
        EXPECT_NEAR(recording->frame_time_s(i), mvsec->frame_time_s(i), 0.51e-6);
      }
    }
  }
}

TEST_F(Simulate, RefusesASensorThatRawDoesNotHold) {
  testing::write_moving_clip(folder_ / "wide", {16, 2049}, 2);
  SimulationManifest manifest =
      testing::moving_clip_manifest(folder_.path(), R"({"path": "wide", "method": "difference"})");
  manifest.file = SimulatedFile::kRaw;
  EXPECT_THROWS(simulate(manifest, {}), UsageError, "1 to 2048 pixels");
}

TEST_F(Simulate, ThreadsAndOtherSourcesDoNotChangeBytes) {
  run("one", 1);
  run("four", 4);
  EXPECT_EQ(files("one"), files("four"));
  run("alone", 2, false, R"({"path": "clip", "name": "still", "method": "affine", "frame_count": 1,
                             "frames_per_image": 3})");
  EXPECT_EQ(files("alone").at("still-000.hdf5"), files("one").at("still-000.hdf5"));
}

TEST_F(Simulate, TheSeedChangesThem) {
  run("a");
  run("b", 1, false, kSources, R"(, "seed": 1)");
  EXPECT_NE(files("a").at("clip.hdf5"), files("b").at("clip.hdf5"));
  EXPECT_NE(files("a").at("still-000.hdf5"), files("b").at("still-000.hdf5"));
}

TEST_F(Simulate, KeepsWhatIsThereAndMakesTheRest) {
  run("out");
  const auto before = files("out");
  std::filesystem::remove(folder_ / "out/still-001.hdf5");
  const SimulationReport report = run("out");
  EXPECT_THAT(report.kept, ::testing::ElementsAre("clip", "fade", "still-000"));
  ASSERT_EQ(report.made.size(), 1u);
  EXPECT_EQ(report.made[0].name, "still-001");
  EXPECT_EQ(files("out"), before);
}

TEST_F(Simulate, RefusesRecordingsOfOtherSettingsUnlessToldToOverwrite) {
  run("out");
  const auto before = files("out");
  const std::string other = R"(, "sensor": {"positive_threshold": 0.5})";
  EXPECT_THROWS(run("out", 1, false, kSources, other), UsageError, "was made by a run that");
  EXPECT_EQ(files("out"), before);
  EXPECT_EQ(run("out", 1, true, kSources, other).made.size(), 4u);
  EXPECT_NE(files("out"), before);
}

TEST_F(Simulate, NeverOverwritesARecordingOfSomethingElse) {
  const std::string source = R"({"path": "clip", "name": "a"})";
  run("out", 1, false, source);
  testing::write_moving_clip(folder_ / "second", {32, 48}, 4);
  testing::write_file(folder_ / "out/b.hdf5", "a camera's, say");
  const auto before = files("out");
  for (const bool overwrite : {false, true}) {
    EXPECT_THROWS(
        run("out", 1, overwrite, R"({"path": "second", "name": "a"})"), UsageError,
        ::testing::AllOf(::testing::HasSubstr(R"($.source.path: expected "clip", got "second")"),
                         ::testing::Not(::testing::HasSubstr("--overwrite"))));
    EXPECT_THROWS(run("out", 1, overwrite, R"({"path": "clip", "name": "b"})"), InputError,
                  "expected no file, or a recording that eventgan simulate has");
    EXPECT_EQ(files("out"), before);
  }
}

TEST_F(Simulate, CountsFramesAsItGoes) {
  std::ostringstream shown;
  SimulationOptions options;
  options.output = folder_ / "out";
  options.make_progress = [&](std::int64_t total) {
    EXPECT_EQ(total, 4 + 4 + 3 + 3);
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, nullptr, total,
                                      std::chrono::steady_clock::now,
                                      ProgressUnit{"frames", false});
  };
  simulate(testing::moving_clip_manifest(folder_.path(), kSources), options);
  EXPECT_THAT(shown.str(), ::testing::HasSubstr("14/14 frames"));
}

TEST_F(Simulate, ABrokenFrameLeavesNoHalfRecording) {
  testing::write_file(folder_ / "clip/002.png", "no image");
  EXPECT_THROWS(run("out", 1, false, R"({"path": "clip"})"), InputError,
                "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM)");
  EXPECT_TRUE(files("out").empty());
}

TEST_F(Simulate, AClipThatIsNotThereLeavesTheOthersToBeMade) {
  EXPECT_THROWS(run("out", 1, false, R"({"path": "absent"}, {"path": "clip"})"), InputError,
                "absent");
  EXPECT_TRUE(files("out").contains("clip.hdf5"));
}

TEST_F(Simulate, CleansUpAfterAKilledRun) {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  ASSERT_EQ(waitpid(child, nullptr, 0), child);  // from here on its pid is that of no process
  const std::string host = host_name();
  const auto temporary = [&](const std::string& writer, pid_t pid) {
    const std::string name = to_string(TemporaryName{"clip.hdf5", writer, pid, 0});
    testing::write_file(folder_ / "out" / name, "half");
    return name;
  };
  const std::string dead = temporary(host, child);
  const std::string alive = temporary(host, getpid());
  const std::string elsewhere = temporary("elsewhere", child);
  run("out", 1, false, R"({"path": "clip"})");
  std::vector<std::string> names;
  for (const auto& [name, bytes] : files("out")) names.push_back(name);
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("clip.hdf5", alive, elsewhere)) << dead;
}

SimulationReport report() {
  return {"/out", {{"a", 11, 3000, 100, 10, 2.5}, {"b", 5, 0, 500, 2, 0}}, {"c"}, 8};
}

TEST(SimulationReport, GivesEventsPerPixelAndSecond) {
  EXPECT_EQ(report().made[0].events_per_pixel_second(), 3);
  EXPECT_EQ(RecordingSummary().events_per_pixel_second(), 0);
  const std::string text = to_text(report());
  EXPECT_THAT(text, ::testing::HasSubstr("3000"));
  // 3000 events in 100 x 10 + 500 x 2 pixel seconds.
  EXPECT_THAT(text, ::testing::ContainsRegex("all +16 +3000 +1.500 +2.5"));
  EXPECT_THAT(
      text, ::testing::HasSubstr("2 recordings made, 1 kept from earlier runs; 8.0 s, 0.50 s per"));
}

TEST(SimulationReport, IsOneLineOfJsonAndOfNothingHasNoTable) {
  const auto json = nlohmann::json::parse(to_json(report()));
  EXPECT_EQ(json.at("made").at(0).at("events"), 3000);
  EXPECT_EQ(json.at("total").at("events_per_pixel_second"), 1.5);
  EXPECT_EQ(json.at("kept").at(0), "c");
  EXPECT_EQ(to_text(SimulationReport()).substr(0, 19), "0 recordings made, ");
}

}  // namespace
}  // namespace eventgan

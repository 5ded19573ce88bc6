#include "pipeline/simulation/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <sstream>

#include "manifests/faults.h"
#include "stages/files/temporary_name.h"
#include "stages/recordings/open_recording.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

const std::string kSources = R"(
  {"path": "clip"}, {"path": "clip", "name": "fade", "method": "difference"},
  {"path": "clip", "name": "still", "method": "affine", "frame_count": 2, "frames_per_picture": 3})";

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

TEST_F(Simulate, ThreadsAndOtherSourcesDoNotChangeBytes) {
  run("one", 1);
  run("four", 4);
  EXPECT_EQ(files("one"), files("four"));
  run("alone", 2, false, R"({"path": "clip", "name": "still", "method": "affine", "frame_count": 1,
                             "frames_per_picture": 3})");
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
  EXPECT_THROW(run("out", 1, false, kSources, other), UsageError);
  EXPECT_EQ(files("out"), before);
  EXPECT_EQ(run("out", 1, true, kSources, other).made.size(), 4u);
  EXPECT_NE(files("out"), before);
}

TEST_F(Simulate, CountsFramesAsItGoes) {
  std::ostringstream shown;
  SimulationOptions options;
  options.output = folder_ / "out";
  options.make_progress = [&](std::int64_t total) {
    EXPECT_EQ(total, 4 + 4 + 3 + 3);
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, false, total,
                                      std::chrono::steady_clock::now,
                                      ProgressUnit{"frames", false});
  };
  simulate(testing::moving_clip_manifest(folder_.path(), kSources), options);
  EXPECT_THAT(shown.str(), ::testing::HasSubstr("14/14 frames"));
}

TEST_F(Simulate, ABrokenFrameLeavesNoHalfRecording) {
  testing::write_file(folder_ / "clip/002.png", "no picture");
  EXPECT_THROW(run("out", 1, false, R"({"path": "clip"})"), InputError);
  EXPECT_TRUE(files("out").empty());
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

}  // namespace
}  // namespace eventgan

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <string>

#include "manifests/values/faults.h"
#include "pipeline/training/training_recording.h"
#include "tests/pipeline/training/bar_training.h"
#include "tests/pipeline/training/fake_training_recording.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using testing::FakeRecording;
using ::testing::HasSubstr;

TEST(OpenTrainingRecordings, KnowsThePartInUse) {
  const testing::TemporaryFolder folder;
  testing::write_bar_recording(folder.path());
  RecordingSpec whole;
  whole.path = "bar.hdf5";
  RecordingSpec part = whole;
  part.path = (folder / "bar.hdf5").string();  // absolute paths too
  part.first_frame = 2;
  part.last_frame = 5;
  part.weight = 4;
  part.threshold = ContrastThreshold{0.3, 2};
  const auto opened =
      open_training_recordings(std::vector{whole, part}, folder.path(), {56, 64}, 1);
  ASSERT_EQ(opened.size(), 2u);
  EXPECT_EQ(opened[0].first_frame, 0);
  EXPECT_EQ(opened[0].last_frame, 8);
  EXPECT_EQ(opened[1].first_frame, 2);
  EXPECT_EQ(opened[1].last_frame, 5);
  EXPECT_EQ(opened[1].weight, 4);
  EXPECT_EQ(opened[0].threshold, std::nullopt);
  EXPECT_EQ(opened[1].threshold, (ContrastThreshold{0.3, 2}));
}

TEST(OpenTrainingRecordings, ListsEveryRecordingOfNoUse) {
  const testing::TemporaryFolder folder;
  testing::write_bar_recording(folder.path());
  RecordingSpec beyond;
  beyond.path = "bar.hdf5";
  beyond.last_frame = 9;
  RecordingSpec late = beyond;
  late.last_frame.reset();
  late.first_frame = 8;
  try {
    open_training_recordings(std::vector{beyond, late}, folder.path(), {16, 16}, 2);
    FAIL() << "expected UsageError";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("expected last_frame below the number of frames, 9, got 9"),
                      HasSubstr("got frames 8 to 8"), HasSubstr("bar.hdf5")));
  }
  EXPECT_THROWS(open_training_recordings(std::vector{late}, folder.path(), {57, 64}, 1), UsageError,
                "expected images of at least 64x57 (crop), got 64x56");
}

TEST(OpenTrainingRecordings, NeedFramesAndSayWhatIsAbsent) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "events.csv", "t,x,y,p\n1,2,3,1\n");
  RecordingSpec table;
  table.path = "events.csv";
  table.format = RecordingFormat::kTable;
  table.options.sensor = ImageSize{16, 16};
  EXPECT_THROWS(open_training_recordings(std::vector{table}, folder.path(), {16, 16}, 1),
                UsageError, "expected a recording with frames, got one without", "events.csv");
  RecordingSpec absent;
  absent.path = "absent.hdf5";
  EXPECT_THROWS(open_training_recordings(std::vector{absent}, "/nowhere", {16, 16}, 1), InputError,
                "expected a recording of an event camera, got a file that");
}

constexpr int kBins = 3;

/// Two frames of 4x6, grey value 10 y + x, then 255 - that; events in the interval (0, 1].
FakeRecording two_frames(std::vector<Event> events) {
  GreyImage first{{4, 6}, {}}, second{{4, 6}, {}};
  for (int i = 0; i < 24; ++i) {
    first.pixels.push_back(static_cast<std::uint8_t>(10 * (i / 6) + i % 6));
    second.pixels.push_back(static_cast<std::uint8_t>(255 - first.pixels.back()));
  }
  FakeRecording recording({first, second}, {0, 1}, std::move(events));
  recording.set_name("desk.hdf5");
  return recording;
}

CropReader reader_of(FakeRecording recording) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(std::move(recording)));
  return CropReader(std::move(recordings), kBins);
}

TEST(CentreCrop, LiesInTheMiddleAndInsideTheImage) {
  const CropBox middle = centre_crop({10, 20}, {4, 5});
  EXPECT_EQ(middle.top, 3);
  EXPECT_EQ(middle.left, 7);
  EXPECT_EQ(middle.size, (ImageSize{4, 5}));
  const CropBox whole = centre_crop({10, 20}, {16, 16});
  EXPECT_EQ(whole.size, (ImageSize{10, 16}));
  EXPECT_EQ(whole.top, 0);
  EXPECT_EQ(whole.left, 2);
}

TEST(CropReader, CutsFrames) {
  const CropReader reader = reader_of(two_frames({}));
  const TrainingSample sample = reader.read(0, 0, 1, {1, 2, {2, 3}});
  ASSERT_EQ(sample.frames.size(), 12u);
  EXPECT_EQ(sample.network_frames, sample.frames);
  EXPECT_FLOAT_EQ(sample.frames[0], (12 / 255.0f - 0.5f) * 2);   // row 1, column 2
  EXPECT_FLOAT_EQ(sample.frames[5], (24 / 255.0f - 0.5f) * 2);   // row 2, column 4
  EXPECT_FLOAT_EQ(sample.frames[6], (243 / 255.0f - 0.5f) * 2);  // the next frame
  EXPECT_EQ(sample.shape, (VolumeShape{kBins, {2, 3}}));
  EXPECT_EQ(sample.origin, "desk.hdf5 frames 0-1 crop 2,1");
}

TEST(CropReader, CutsEventsBeforeItMakesTheVolume) {
  // Outside the rectangle is the first event; of the events inside the first is in bin 0 and the
  // last in the last bin, and the third, halfway between those two, in the middle one.
  const CropReader reader = reader_of(two_frames({{0, 0, 0.1, true},
                                                  {2, 1, 0.5, true},
                                                  {3, 1, 0.6, false},
                                                  {4, 2, 0.7, true},
                                                  {5, 3, 0.9, true}}));
  const TrainingSample sample = reader.read(0, 0, 1, {1, 2, {2, 3}});
  std::vector<float> expected(sample.shape.value_count(), 0.0f);
  const auto at = [&](int channel, int y, int x) -> float& {
    return expected[static_cast<std::size_t>((channel * 2 + y) * 3 + x)];
  };
  at(0, 0, 0) = 1;
  at(kBins + 1, 0, 1) = 1;
  at(kBins - 1, 1, 2) = 1;
  ASSERT_EQ(sample.volume.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(sample.volume[i], expected[i], 1e-5) << i;
  }
}

CropReader sensor_reader_of(FakeRecording recording) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(std::move(recording)));
  recordings[0].threshold = ContrastThreshold{0.25, 1.5};
  return CropReader(std::move(recordings), kBins);
}

TEST(CropReader, CountsEventsBetweenTheFramesTimesWhereItKnowsTheThreshold) {
  // Of frames at 0 and 1 s, t* = 2 t: 0.5 at 0.25 s, 1 at 0.5 s, 2 at 1 s; five at one pixel. One
  // lies outside of the rectangle.
  std::vector<Event> events(5, {2, 1, 0.25, true});
  for (const Event& event : {Event{0, 0, 0.3, true}, {3, 1, 0.5, false}, {4, 2, 1, true}}) {
    events.push_back(event);
  }
  const CropReader reader = sensor_reader_of(two_frames(events));
  const TrainingSample sample = reader.read(0, 0, 1, {1, 2, {2, 3}});
  EXPECT_EQ(sample.threshold, (ContrastThreshold{0.25, 1.5}));
  std::vector<float> expected(sample.shape.value_count(), 0.0f);
  const auto at = [&](int channel, int y, int x) -> float& {
    return expected[static_cast<std::size_t>((channel * 2 + y) * 3 + x)];
  };
  at(0, 0, 0) = at(1, 0, 0) = 2.5f;
  at(kBins + 1, 0, 1) = 1;
  at(2, 1, 2) = 1;
  EXPECT_THAT(sample.volume, ::testing::Pointwise(::testing::FloatNear(1e-6f), expected));
}

TEST(CropReader, WithAThresholdOfOneEventIsWhereItIsAndOfNoneEmpty) {
  // Without a threshold it spans the bins alone, and lies in the first.
  for (const bool known : {false, true}) {
    const FakeRecording recording = two_frames({{0, 0, 0.75, true}});
    const CropReader reader = known ? sensor_reader_of(recording) : reader_of(recording);
    const TrainingSample sample = reader.read(0, 0, 1, {0, 0, {1, 1}});
    EXPECT_EQ(sample.threshold.has_value(), known);
    const std::vector<float> expected =
        known ? std::vector<float>{0, 0.5f, 0.5f, 0, 0, 0} : std::vector<float>{1, 0, 0, 0, 0, 0};
    EXPECT_EQ(sample.volume, expected);
  }
  const CropReader reader = sensor_reader_of(two_frames({{0, 0, 0.5, true}}));
  for (const std::int64_t first : {0, 1}) {
    const TrainingSample sample = reader.read(0, first, 1, {1, 1, {2, 2}});
    EXPECT_THAT(sample.volume, ::testing::Each(0.0f));
    EXPECT_EQ(sample.volume.size(), 2u * kBins * 4);
    EXPECT_TRUE(sample.threshold.has_value());
  }
}

TEST(CropReader, JoinsTheIntervalsOfALongPair) {
  const FakeRecording bar = testing::moving_bar_recording({16, 16}, 4);
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(bar));
  const CropReader reader(std::move(recordings), kBins);
  const TrainingSample sample = reader.read(0, 0, 3, {0, 0, {16, 16}});
  // Each pixel change is one event: first and last frame's bars are 6 columns apart.
  EXPECT_EQ(reader.event_count(0, 0) + reader.event_count(0, 1) + reader.event_count(0, 2),
            bar.events_between(0, 3).size());
  EXPECT_FLOAT_EQ(*std::max_element(sample.volume.begin(), sample.volume.end()), 1);
}

TEST(CropReader, OneFrameTwiceHasNoEvents) {
  const CropReader reader = reader_of(two_frames({{0, 0, 0.5, true}}));
  const TrainingSample sample = reader.read(0, 1, 1, {0, 0, {4, 6}});
  EXPECT_TRUE(std::all_of(sample.volume.begin(), sample.volume.end(),
                          [](float value) { return value == 0; }));
  EXPECT_TRUE(
      std::equal(sample.frames.begin(), sample.frames.begin() + 24, sample.frames.begin() + 24));
}

/// Counts reads; the third frame cannot be read.
class CountedRecording final : public Recording {
 public:
  explicit CountedRecording(std::shared_ptr<std::atomic<int>> reads) : reads_(std::move(reads)) {}
  const std::string& name() const override { return bar_.name(); }
  ImageSize size() const override { return bar_.size(); }
  std::int64_t frame_count() const override { return bar_.frame_count(); }
  double frame_time_s(std::int64_t index) const override { return bar_.frame_time_s(index); }
  GreyImage frame(std::int64_t index) const override {
    ++*reads_;
    if (index == 2) throw InputError("expected frame 2, got none, in bar.hdf5");
    return bar_.frame(index);
  }
  std::vector<Event> events_between(std::int64_t first, std::int64_t last) const override {
    ++*reads_;
    return bar_.events_between(first, last);
  }
  std::vector<Event> events_in(double after_s, double until_s) const override {
    return bar_.events_in(after_s, until_s);
  }
  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override {
    return bar_.events_around(time_s, before, after);
  }
  std::optional<std::array<double, 2>> event_span() const override { return bar_.event_span(); }
  std::optional<FlowField> flow(std::int64_t) const override { return std::nullopt; }

 private:
  FakeRecording bar_ = testing::moving_bar_recording({16, 16}, 4);
  std::shared_ptr<std::atomic<int>> reads_;
};

TEST(CropReader, ReadsEachFrameAndIntervalOnce) {
  const auto reads = std::make_shared<std::atomic<int>>(0);
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(CountedRecording(reads)));
  const CropReader reader(std::move(recordings), kBins);
  for (int i = 0; i < 5; ++i) reader.read(0, 0, 1, {i, 0, {8, 8}});
  EXPECT_EQ(*reads, 3);  // two frames, one interval
}

TEST(CropReader, PassesOnWhatTheRecordingThrows) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(CountedRecording(std::make_shared<std::atomic<int>>(0))));
  const CropReader reader(std::move(recordings), kBins);
  try {
    reader.read(0, 1, 2, {0, 0, {8, 8}});
    FAIL() << "expected InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("bar.hdf5"));
  }
}

}  // namespace
}  // namespace eventgan

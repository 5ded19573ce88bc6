#include "stages/recordings/writers/mvsec_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <span>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/recording.h"
#include "stages/recordings/writers/detail/growing_dataset.h"
#include "tests/stages/recordings/small_recording.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class GrowingDatasetTest : public ::testing::Test {
 protected:
  /// Writes `values` as [rows, 2], `portion` of them at a time, 3 rows a chunk.
  testing::GoldenArray write_and_read(const std::vector<float>& values, std::size_t portion) {
    {
      const Hdf5Lock lock;
      const Hdf5Handle file(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                            H5Fclose);
      GrowingDataset<float> dataset(file, "d", {2}, {3, 1}, 3);
      for (std::size_t at = 0; at < values.size(); at += portion) {
        dataset.append(std::span(values).subspan(at, std::min(portion, values.size() - at)));
      }
      dataset.close();
    }
    return testing::read_array(path_, "d");
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "f.h5";
};

TEST_F(GrowingDatasetTest, KeepsRowsInOrder) {
  for (const std::size_t rows : {0u, 1u, 3u, 4u, 6u, 10u}) {
    std::vector<float> values(2 * rows);
    std::iota(values.begin(), values.end(), 1.0f);
    for (const std::size_t portion : {2u, 4u, 100u}) {
      const testing::GoldenArray read = write_and_read(values, portion);
      EXPECT_EQ(read.shape, (std::vector<std::size_t>{rows, 2}));
      EXPECT_EQ(read.values, values);
    }
  }
}

constexpr ImageSize kSize{3, 4};

GreyImage frame_of(std::uint8_t value) { return {kSize, std::vector<std::uint8_t>(12, value)}; }

FlowField flow_of(float x_px) {
  return {kSize, std::vector<float>(12, x_px), std::vector<float>(12, -x_px)};
}

class MvsecWriterTest : public ::testing::Test {
 protected:
  /// The recording of small_recording.h, its events in portions of `portion`.
  void write_small(const std::filesystem::path& path, std::size_t portion) {
    const std::vector<Event> events = testing::small_events();
    const FlowField flows[] = {flow_of(1), flow_of(2)};
    MvsecWriter writer(path, kSize, "{\"seed\": 7}");
    const auto add = [&](std::size_t begin, std::size_t end) {
      for (; begin < end; begin += portion) {
        writer.add_events(std::span(events).subspan(begin, std::min(portion, end - begin)));
      }
    };
    add(0, 2);
    writer.add_frame(frame_of(10), 1.0, nullptr);
    add(2, 4);
    writer.add_frame(frame_of(20), 1.5, &flows[0]);
    add(4, 6);
    writer.add_frame(frame_of(30), 2.0, &flows[1]);
    add(6, 7);
    writer.commit();
  }
  std::unique_ptr<Recording> open() { return open_recording(path_, RecordingFormat::kMvsec); }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "simulated.hdf5";
};

TEST_F(MvsecWriterTest, WritesWhatIsReadBack) {
  write_small(path_, 100);
  const auto recording = open();
  EXPECT_EQ(recording->size(), kSize);
  ASSERT_EQ(recording->frame_count(), 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(recording->frame_time_s(i), testing::kSmallTimes[static_cast<std::size_t>(i)]);
    EXPECT_EQ(recording->frame(i), frame_of(static_cast<std::uint8_t>(10 * (i + 1))));
  }
  const std::vector<Event> events = testing::small_events();
  EXPECT_EQ(recording->events_between(0, 2),
            (std::vector<Event>(events.begin() + 2, events.begin() + 6)));
  EXPECT_EQ(recording->flow(1)->x_px, flow_of(2).x_px);
  EXPECT_EQ(recording->flow(1)->y_px, flow_of(2).y_px);
  EXPECT_THAT(testing::names_in(folder_.path()), ElementsAre("simulated.hdf5"));
}

TEST_F(MvsecWriterTest, KeepsMvsecsLayout) {
  write_small(path_, 100);
  using Shape = std::vector<std::size_t>;
  const auto dataset = [&](const char* name) {
    return testing::read_array(path_, std::string("davis/left/") + name);
  };
  EXPECT_EQ(dataset("events").shape, (Shape{7, 4}));
  const std::vector<float> rows = dataset("events").values;
  EXPECT_THAT(std::span(rows).subspan(4, 4), ElementsAre(1, 0, 1.0f, -1));
  EXPECT_EQ(dataset("image_raw").shape, (Shape{3, 3, 4}));
  EXPECT_THAT(dataset("image_raw_ts").values, ElementsAre(1.0f, 1.5f, 2.0f));
  // The last event at or before the frame: the second has the first frame's own time.
  EXPECT_THAT(dataset("image_raw_event_inds").values, ElementsAre(1, 3, 5));
  EXPECT_EQ(dataset("flow_dist").shape, (Shape{2, 2, 3, 4}));
}

TEST_F(MvsecWriterTest, GivesTheSameBytesHoweverEventsArePortioned) {
  write_small(path_, 100);
  write_small(folder_ / "again.hdf5", 1);
  EXPECT_EQ(testing::read_file(path_), testing::read_file(folder_ / "again.hdf5"));
}

TEST_F(MvsecWriterTest, KeepsMoreEventsThanOneChunk) {
  std::vector<Event> events;
  for (int i = 0; i < 100'000; ++i) events.push_back({i % 4, i % 3, 1 + 1e-6 * i, i % 5 == 0});
  for (const std::size_t portion : {100'000u, 777u}) {
    MvsecWriter writer(path_, kSize, "");
    writer.add_frame(frame_of(1), 0.5, nullptr);
    for (std::size_t begin = 0; begin < events.size(); begin += portion) {
      writer.add_events(std::span(events).subspan(begin, std::min(portion, events.size() - begin)));
    }
    writer.add_frame(frame_of(2), 2, nullptr);
    writer.commit();
    EXPECT_EQ(open()->events_between(0, 1), events);
    EXPECT_FALSE(open()->flow(0).has_value());
  }
}

TEST_F(MvsecWriterTest, RoundTripsARecordingOfMotion) {
  const testing::FakeRecording bar = testing::moving_bar_recording({5, 16}, 4);
  MvsecWriter writer(path_, bar.size(), "bar");
  for (int i = 0; i < 4; ++i) {
    if (i > 0) writer.add_events(bar.events_between(i - 1, i));
    const std::optional<FlowField> flow = i > 0 ? bar.flow(i - 1) : std::nullopt;
    writer.add_frame(bar.frame(i), bar.frame_time_s(i), flow ? &*flow : nullptr);
  }
  writer.commit();
  const auto recording = open();
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(recording->events_between(i, i + 1), bar.events_between(i, i + 1));
    // Two columns light up and two go dark in each interval, of 5 pixels each.
    EXPECT_EQ(recording->events_between(i, i + 1).size(), 20u);
    EXPECT_EQ(recording->flow(i)->x_px, bar.flow(i)->x_px);
  }
}

TEST_F(MvsecWriterTest, WritesOneFrameWithoutEvents) {
  MvsecWriter writer(path_, kSize, "");
  writer.add_events({});
  writer.add_frame(frame_of(1), 0, nullptr);
  writer.commit();
  EXPECT_THAT(open()->events_between(0, 0), IsEmpty());
  EXPECT_THAT(testing::read_array(path_, "davis/left/image_raw_event_inds").values,
              ElementsAre(-1));
}

TEST_F(MvsecWriterTest, LeavesNothingWithoutCommit) {
  testing::write_file(path_, "what was there before");
  {
    MvsecWriter writer(path_, kSize, "");
    writer.add_frame(frame_of(1), 0, nullptr);
    EXPECT_EQ(testing::names_in(folder_.path()).size(), 2u);
  }
  EXPECT_THAT(testing::names_in(folder_.path()), ElementsAre("simulated.hdf5"));
  EXPECT_EQ(testing::read_file(path_), "what was there before");
  write_small(path_, 100);
  EXPECT_EQ(open()->frame_count(), 3);
}

TEST_F(MvsecWriterTest, RefusesEventsOutOfPlaceAndAddsNone) {
  MvsecWriter writer(path_, kSize, "");
  writer.add_frame(frame_of(1), 1, nullptr);
  writer.add_events(std::vector<Event>{{0, 0, 1.5, true}});
  const std::pair<std::vector<Event>, const char*> wrong[] = {
      {{{0, 0, 2, true}, {4, 0, 2, true}}, "got x = 4, y = 0"},
      {{{0, 3, 2, true}}, "got x = 0, y = 3"},
      {{{-1, 0, 2, true}}, "got x = -1, y = 0"},
      {{{0, 0, std::nan(""), true}}, "expected a finite time, got nan"},
      {{{0, 0, HUGE_VAL, true}}, "expected a finite time, got inf"},
      {{{0, 0, 1.25, true}}, "expected events in time order, over all calls"},
      {{{0, 0, 1.0, true}}, "expected a time after 1 s, got the same"},
      {{{0, 0, 3, true}, {0, 0, 2, true}}, "got 2 s after 3 s"}};
  for (const auto& [events, words] : wrong) {
    EXPECT_THROWS(writer.add_events(events), std::invalid_argument, words);
  }
  writer.add_frame(frame_of(2), 2, nullptr);
  EXPECT_THROWS(writer.add_events(std::vector<Event>{{0, 0, 2, true}}), std::invalid_argument,
                "expected a time after 2 s, got the same");
  writer.commit();
  EXPECT_EQ(open()->events_between(0, 1), (std::vector<Event>{{0, 0, 1.5, true}}));
}

TEST_F(MvsecWriterTest, RefusesFramesOutOfPlaceAndAddsNone) {
  const FlowField flow = flow_of(1);
  const FlowField other{{4, 3}, std::vector<float>(12), std::vector<float>(12)};
  const FlowField short_field{kSize, std::vector<float>(12), std::vector<float>(11)};
  MvsecWriter writer(path_, kSize, "");
  const auto refuses = [&](const GreyImage& frame, double time_s, const FlowField* to,
                           const char* words) {
    EXPECT_THROWS(writer.add_frame(frame, time_s, to), std::invalid_argument, words);
  };
  const char* const of_size = "expected frames of the recording's size";
  const char* const in_order = "expected a frame after the one before and not before any event";
  refuses(frame_of(1), 0, &flow, "expected no flow to the first frame");
  refuses({{4, 3}, std::vector<std::uint8_t>(12)}, 0, nullptr, of_size);
  refuses({kSize, std::vector<std::uint8_t>(11)}, 0, nullptr, of_size);
  refuses(frame_of(1), std::nan(""), nullptr, in_order);
  writer.add_frame(frame_of(1), 0, nullptr);
  refuses(frame_of(1), 0, nullptr, in_order);
  refuses(frame_of(1), 1, &other, "expected a flow of the recording's size");
  refuses(frame_of(1), 1, &short_field, "expected a flow of the recording's size");
  writer.add_frame(frame_of(2), 1, &flow);
  refuses(frame_of(3), 2, nullptr, "expected a flow to every frame but the first, or none");
  writer.add_events(std::vector<Event>{{0, 0, 3, true}});
  refuses(frame_of(3), 2, &flow, in_order);
  writer.commit();
  EXPECT_EQ(open()->frame_count(), 2);
}

TEST_F(MvsecWriterTest, IsCommittedOnceAndWithFrames) {
  MvsecWriter writer(path_, kSize, "");
  EXPECT_THROWS(writer.commit(), std::logic_error, "expected at least one frame, got none, in");
  writer.add_frame(frame_of(1), 0, nullptr);
  writer.commit();
  const char* const no_more = "expected no more calls after commit";
  EXPECT_THROWS(writer.commit(), std::logic_error, no_more);
  EXPECT_THROWS(writer.add_frame(frame_of(1), 1, nullptr), std::logic_error, no_more);
  EXPECT_THROWS(MvsecWriter(folder_ / "x", ImageSize{0, 4}, ""), std::invalid_argument,
                "expected an image size of at least 1x1");
  EXPECT_THROWS(MvsecWriter(folder_ / "absent" / "x.hdf5", kSize, ""), std::runtime_error,
                "absent/x.hdf5");
}

TEST_F(MvsecWriterTest, TellsOfAFullDiskAndLeavesNothing) {
  const std::string error = testing::error_on_full_disk(2000, [&] { write_small(path_, 100); });
  EXPECT_THAT(error, HasSubstr("cannot write the recording " + path_.string()));
  EXPECT_THAT(testing::names_in(folder_.path()), IsEmpty());
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/events/windowed_recording.h"

#include <fmt/core.h>

#include <cstdint>
#include <tuple>

#include "tests/stages/frames/events/recording_dataset_fixture.h"

namespace eventgan {
namespace {

using WindowedRecordingTest = RecordingDatasetTest;

TEST_F(WindowedRecordingTest, WithoutLabelsEachFrameEndsItsInterval) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("drive/0000000001.500000", "drive/0000000002.000000"));
  EXPECT_EQ(window(*dataset, 0), (std::array{1.0, 1.5}));
  EXPECT_EQ(window(*dataset, 1), (std::array{1.5, 2.0}));
  EXPECT_THAT(events(*dataset, 0), ElementsAre(all_[2], all_[3]));
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[4], all_[5]));
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(dataset->paired_frame(frame, -1).frame, (FrameRef{"drive.h5", 0, 0}));
  EXPECT_EQ(dataset->paired_frame(frame, 1).frame, (FrameRef{"drive.h5", 1, 1}));
  EXPECT_THAT(paired(*dataset, 0, {2}), ElementsAre("beyond"));
  EXPECT_EQ(dataset->sensor_size(frame.label_key), (ImageSize{3, 4}));
  EXPECT_EQ(annotation_of(*dataset), Annotation{});
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(WindowedRecordingTest, LabelsAreAtTheEndOrInTheMiddleOfTheirWindows) {
  // On a frame but for what six decimals lose; between two; without a box.
  label("1.5000004,0,0,2,1,car,easy\n1.75,0,0,1,1,bus,\n2.25\n");
  auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("drive/0000000001.500000", "drive/0000000001.750000",
                                            "drive/0000000002.250000"));
  EXPECT_EQ(window(*dataset, 0), (std::array{1.0, 1.5}));
  EXPECT_EQ(window(*dataset, 1), (std::array{1.25, 1.75}));
  EXPECT_EQ(window(*dataset, 2), (std::array{1.75, 2.25}));  // as long as the last interval
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[4]));
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("bus", "car"));
  EXPECT_THAT(annotation_of(*dataset).boxes,
              ElementsAre(Box{.class_id = 1, .xyxy = {0, 0, 2, 1}, .difficulty = 0}));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("drive.csv"));
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key),
            "drive.csv (1.500000 s)");
  spec_.window.label = LabelPlace::kMiddle;
  dataset = open();
  EXPECT_EQ(window(*dataset, 0), (std::array{1.25, 1.75}));
  EXPECT_EQ(window(*dataset, 1), (std::array{1.5, 2.0}));
}

TEST_F(WindowedRecordingTest, AWindowIsAsLongAsTheIntervalThatItsLabelLiesInOrEnds) {
  auto datasets = testing::small_mvsec();
  datasets["davis/left/image_raw_ts"] = {{3}, std::vector<double>{1.0, 1.5, 2.5}};
  datasets.erase("davis/left/image_raw_event_inds");
  testing::write_hdf5(at("drive.h5"), datasets);
  label("0.75\n1\n1.25\n1.5\n2\n2.5\n3\n");  // as long as the nearest
  const auto dataset = open();
  const double lengths[] = {0.5, 0.5, 0.5, 0.5, 1, 1, 1};
  for (std::size_t i = 0; i < std::size(lengths); ++i) {
    const auto [begin_s, end_s] = window(*dataset, i);
    EXPECT_EQ(end_s - begin_s, lengths[i]) << end_s;
  }
}

TEST_F(WindowedRecordingTest, AWindowMayLastSoManySeconds) {
  label("1\n1.5\n2.5\n");
  spec_.window.duration_s = 0.25;
  EXPECT_EQ(window(*open(), 1), (std::array{1.25, 1.5}));
  EXPECT_THAT(events(*open(), 0), ElementsAre(all_[1]));
  EXPECT_THAT(events(*open(), 1), IsEmpty()) << "1.25 is no part of it";
  EXPECT_THAT(events(*open(), 2), ElementsAre(all_[6]));
  spec_.window.label = LabelPlace::kMiddle;
  EXPECT_EQ(window(*open(), 1), (std::array{1.375, 1.625}));
}

TEST_F(WindowedRecordingTest, AWindowMayHoldSoManyEvents) {
  label("0.5\n1.25\n2.5\n");
  spec_.window.events = 3;
  const auto dataset = open();
  EXPECT_THAT(events(*dataset, 0), ElementsAre(all_[0]));  // there are no more
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[1], all_[2], all_[3]));
  EXPECT_THAT(events(*dataset, 2), ElementsAre(all_[4], all_[5], all_[6]));
  EXPECT_THAT(window(*dataset, 1), Each(::testing::IsNan()));
  spec_.window.label = LabelPlace::kMiddle;  // one up to the time, two behind it
  EXPECT_THAT(events(*open(), 1), ElementsAre(all_[3], all_[4], all_[5]));
}

TEST_F(WindowedRecordingTest, WithoutLabelsTheFirstFrameEndsAWindowOfItsOwn) {
  spec_.window.events = 1;
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 3u);
  EXPECT_THAT(events(*dataset, 0), ElementsAre(all_[1]));
}

TEST_F(WindowedRecordingTest, OneFrameNeedsAWindow) {
  auto datasets = testing::small_mvsec();
  datasets["davis/left/image_raw"].shape[0] = 1;
  datasets["davis/left/image_raw"].values = std::vector<std::uint8_t>(12);
  datasets["davis/left/image_raw_ts"] = {{1}, std::vector<double>{1.0}};
  datasets.erase("davis/left/image_raw_event_inds");
  datasets.erase("davis/left/flow_dist");
  testing::write_hdf5(at("drive.h5"), datasets);
  refused("expected two frames or more, or window_s");
  spec_.window.duration_s = 1;
  EXPECT_THAT(events(*open(), 0), ElementsAre(all_[0], all_[1]));
}

TEST_F(WindowedRecordingTest, TimesOutsideTheRecordingAreFaults) {
  label("0.25\n0.5\n2.5\n2.75,1,1,2,2,car,\n");
  const auto dataset = open();
  EXPECT_THAT(faults_of(*dataset),
              ElementsAre("expected a time between 0.5 s and 2.5 s, which the recording lasts, got "
                          "0.25 s, in drive.csv (0.250000 s) (drive/0000000000.250000)",
                          "", "", HasSubstr("got 2.75 s")));
  EXPECT_EQ(window(*dataset, 1), (std::array{0.0, 0.5}));  // as long as the first interval
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[0]));
}

// Frames at 0.1, 0.2 and 0.3 s, a label between two, and an event where its window begins.
TEST_F(WindowedRecordingTest, AnEventAtTheBeginOfAWindowBetweenFramesIsNotInIt) {
  for (const auto& [place, label_s, begin_s, end_s] :
       {std::tuple(LabelPlace::kEnd, "0.150000", 0.05, 0.15),
        {LabelPlace::kEnd, "0.250000", 0.15, 0.25},
        {LabelPlace::kMiddle, "0.150000", 0.1, 0.2},
        {LabelPlace::kMiddle, "0.250000", 0.2, 0.3},
        {LabelPlace::kEnd, "0.200000", 0.1, 0.2}}) {
    SCOPED_TRACE(label_s);
    auto mvsec = testing::small_mvsec();
    mvsec.insert_or_assign("davis/left/image_raw_ts",
                           testing::Hdf5Dataset{{3}, std::vector<double>{0.1, 0.2, 0.3}});
    mvsec.insert_or_assign(
        "davis/left/events",
        testing::Hdf5Dataset{{3, 4},
                             std::vector<double>{0, 0, begin_s, 1, 0, 0, end_s, 1, 0, 0, 0.4, 1}});
    testing::write_hdf5(at("drive.h5"), mvsec);
    label(std::string(label_s) + ",0,0,1,1,car,\n");
    spec_.window.label = place;
    const auto dataset = open();
    EXPECT_EQ(window(*dataset, 0), (std::array{begin_s, end_s}));
    EXPECT_THAT(events(*dataset, 0), ElementsAre(Event{0, 0, end_s, true}));
  }
}

/// The small recording's events alone, at 0.5, 1, 1.25, 1.25, 1.75, 2 and 2.5 s.
class WithoutFramesTest : public WindowedRecordingTest {
 protected:
  WithoutFramesTest() {
    std::string table = "t,x,y,p\n";
    for (const Event& event : all_) {
      table += fmt::format("{},{},{},{}\n", event.t_s, event.x, event.y, event.positive ? 1 : 0);
    }
    write("table.csv", table);
    spec_.root = "table.csv";
    spec_.recording.sensor = ImageSize{3, 4};
    spec_.recording.columns.tick_s = 1;
  }
};

TEST_F(WithoutFramesTest, WindowsFollowEachOtherFromTheFirstEventOn) {
  spec_.window.duration_s = 0.75;
  auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const double begin_s = 0.49999975 + 0.75 * static_cast<double>(i);
    EXPECT_DOUBLE_EQ(window(*dataset, i)[0], begin_s);
    EXPECT_DOUBLE_EQ(window(*dataset, i)[1], begin_s + 0.75);
    EXPECT_EQ(dataset->labelled_frames()[i].fault, "");
    EXPECT_EQ(dataset->labelled_frames()[i].frame, (FrameRef{"table.csv", -1, -1}));
  }
  EXPECT_THAT(events(*dataset, 0), ElementsAre(all_[0], all_[1]));
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[2], all_[3], all_[4]));
  EXPECT_THAT(events(*dataset, 2), ElementsAre(all_[5], all_[6]));
  EXPECT_THAT(dataset->notes(), IsEmpty());
  spec_.window.label = LabelPlace::kMiddle;
  dataset = open();
  EXPECT_DOUBLE_EQ(window(*dataset, 1)[0], 1.24999975);
  EXPECT_THAT(events(*dataset, 1), ElementsAre(all_[2], all_[3], all_[4]));
  spec_.window.duration_s = 100;
  EXPECT_EQ(events(*open(), 0).size(), 7u);
}

TEST_F(WithoutFramesTest, NoEventFallsBetweenTwoWindowsOfAClockOfTheDay) {
  // At 1.6e9 s two doubles are 0.24 us apart, and 0.1 s is none of them.
  constexpr std::int64_t kBegin_us = 1'600'000'000'000'000, kLength_us = 100'000, kWindows = 500;
  std::string table = "t,x,y,p\n";
  for (std::int64_t i = 0; i <= kWindows; ++i) {
    for (const int beside : {0, 1, 2}) {
      table += fmt::format("{},1,1,1\n", kBegin_us + i * kLength_us + beside);
    }
  }
  write("table.csv", table);
  spec_.recording.columns.tick_s = 1e-6;
  for (const LabelPlace place : {LabelPlace::kEnd, LabelPlace::kMiddle}) {
    spec_.window = {.duration_s = 0.1, .events = std::nullopt, .label = place};
    const auto dataset = open();
    std::size_t found = 0;
    for (std::size_t i = 0; i < dataset->labelled_frames().size(); ++i) {
      found += events(*dataset, i).size();
    }
    EXPECT_EQ(found, 3u * (kWindows + 1));
  }
}

TEST_F(WithoutFramesTest, LabelsMakeWindowsOfTimeOrOfEvents) {
  write("labels.csv", kLabelHeader + "1.25,0,0,2,1,car,\n3\n"s);
  spec_.annotations = "labels.csv";
  spec_.window.events = 2;
  EXPECT_THAT(events(*open(), 0), ElementsAre(all_[2], all_[3]));
  EXPECT_THAT(faults_of(*open())[1], HasSubstr("which the recording lasts, got 3 s"));
  spec_.window = {.duration_s = 0.25, .events = std::nullopt, .label = LabelPlace::kEnd};
  EXPECT_THAT(events(*open(), 0), ElementsAre(all_[2], all_[3]));
  spec_.window.duration_s.reset();
  refused("expected window_s or window_events, since the recording has no frames, got neither");
}

TEST_F(WithoutFramesTest, ALabelMayLieBehindTheLastEventAsFarAsItsWindowReaches) {
  write("labels.csv", kLabelHeader + "2.74,0,0,2,1,car,\n2.75,0,0,2,1,car,\n"s);
  spec_.annotations = "labels.csv";
  spec_.window.duration_s = 0.25;
  EXPECT_THAT(faults_of(*open()),
              ElementsAre("", HasSubstr("which the recording lasts, got 2.75")));
  EXPECT_THAT(events(*open(), 0), ElementsAre(all_[6]));
}

TEST_F(WithoutFramesTest, NothingIsGuessed) {
  refused("expected window_s, or labels, since the recording has no frames");
  spec_.window.events = 3;
  refused("got window_events alone");
  spec_.window.events.reset();
  spec_.window.duration_s = 1e-7;
  refused("expected events of at most 10000000 windows");
  spec_.recording.sensor.reset();
  refused("\"sensor\": {");
}

TEST_F(WithoutFramesTest, AnEventAtAWindowsBeginIsNotInIt) {
  // Events each millisecond of DSEC's clock, labels each 10 ms at an event's time: ten are in each.
  std::string table = "t,x,y,p\n", labels = kLabelHeader;
  constexpr std::int64_t kStart_us = 51'648'500'652;
  for (int ms = 0; ms < 400; ++ms) {
    table += std::to_string(kStart_us + 1000 * ms) + ",0,0,1\n";
    if (ms % 10 != 0 || ms == 0) continue;
    const std::int64_t label_us = kStart_us + 1000 * ms;
    labels += fmt::format("{}.{:06d},0,0,1,1,car,\n", label_us / 1'000'000, label_us % 1'000'000);
  }
  write("table.csv", table);
  write("labels.csv", labels);
  spec_.annotations = "labels.csv";
  spec_.recording.columns.tick_s = 1e-6;
  spec_.window.duration_s = 0.01;
  for (const LabelPlace place : {LabelPlace::kEnd, LabelPlace::kMiddle}) {
    spec_.window.label = place;
    const auto dataset = open();
    for (std::size_t i = 0; i < 39; ++i) EXPECT_EQ(events(*dataset, i).size(), 10u) << i;
  }
}

TEST_F(WithoutFramesTest, WithoutEventsItIsAStillScene) {
  write("all/a.csv", "t,x,y,p\n1,0,0,1\n2,0,0,1\n");
  write("all/b.csv", "t,x,y,p\n");
  write("labels/b.csv", kLabelHeader + "5,0,0,2,1,car,\n7.5\n"s);
  struct Row {
    const char* root;
    std::optional<std::string> labels;
    WindowSpec window;
    const char* note;
  };
  const WindowSpec second{.duration_s = 1, .events = std::nullopt, .label = LabelPlace::kEnd};
  const WindowSpec events{.duration_s = std::nullopt, .events = 3, .label = LabelPlace::kEnd};
  for (const Row& each : {Row{"all", {}, second, "(1 empty event volume): all/b.csv"},
                          {"all/b.csv", {}, second, "(1 empty event volume): all/b.csv"},
                          {"all", "labels", second, "(2 empty"},
                          {"all", "labels", events, "(2 empty"}}) {
    SCOPED_TRACE(each.root);
    spec_.root = each.root;
    spec_.annotations = each.labels;
    spec_.window = each.window;
    const auto dataset = open();
    if (each.labels) {
      EXPECT_THAT(ids_of(*dataset), ElementsAre("b/0000000005.000000", "b/0000000007.500000"));
    }
    EXPECT_THAT(faults_of(*dataset), Each(""));
    const LabelledFrame& still = dataset->labelled_frames().back();
    EXPECT_EQ(still.sequence, "b");
    EXPECT_EQ(dataset->sensor_size(still.label_key), (ImageSize{3, 4}));
    EXPECT_THAT(dataset->events(still.label_key)->events, IsEmpty());
    EXPECT_THAT(dataset->warnings(), ElementsAre(HasSubstr(each.note)));
    EXPECT_THAT(dataset->notes(), Contains(HasSubstr(each.note)));
  }
}

}  // namespace
}  // namespace eventgan

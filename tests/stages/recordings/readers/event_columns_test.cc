#include "stages/recordings/readers/detail/event_columns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Numbers = std::vector<std::int64_t>;

/// A sequence of 4x3 pixels (width x height): five events at 0, 1, 1, 2.5 and 3 ms after 10 s.
class DsecTest : public ::testing::Test {
 protected:
  DsecTest() {
    options_.sensor = ImageSize{3, 4};
    datasets_ = {{"events/x", {{5}, Numbers{0, 1, 2, 3, 0}}},
                 {"events/y", {{5}, Numbers{0, 1, 2, 0, 1}}},
                 {"events/t", {{5}, Numbers{0, 1000, 1000, 2500, 3000}}},
                 {"events/p", {{5}, Numbers{0, 1, 1, 0, 1}}},
                 {"ms_to_idx", {{4}, Numbers{0, 1, 3, 4}}},
                 {"t_offset", {{}, Numbers{10'000'000}}}};
  }

  std::unique_ptr<Recording> open(const char* name = "seq") {
    std::filesystem::create_directories(folder_ / "seq/events/left");
    // Not over the file of a recording that is open.
    std::filesystem::remove(folder_ / "seq/events/left/events.h5");
    testing::write_hdf5(folder_ / "seq/events/left/events.h5", datasets_);
    return open_dsec_recording(folder_ / name, options_);
  }

  void refuses(const std::string& what) {
    EXPECT_THROWS(open(), InputError, what, "seq/events/left/");
  }

  void refuses_events(const std::string& what) {
    const auto recording = open();
    EXPECT_THROWS(recording->events_in(0, 100), InputError, what, "(event ");
  }

  /// Images of one grey value each.
  void write_images(const std::string& view, ImageSize size, int count) {
    for (int i = 0; i < count; ++i) {
      const std::vector<std::uint8_t> pixels(3 * size.pixel_count(),
                                             static_cast<std::uint8_t>(10 * i));
      testing::write_file(
          folder_ / ("seq/images/left/" + view + "/00" + std::to_string(i) + ".png"),
          encode_png({size, pixels.data()}));
    }
  }

  testing::TemporaryFolder folder_;
  std::map<std::string, testing::Hdf5Dataset> datasets_;
  RecordingOptions options_;
};

TEST_F(DsecTest, AddsTheOffsetAndFindsEventsByTheirTimes) {
  for (const char* name : {"seq", "seq/events/left/events.h5"}) {
    const auto recording = open(name);
    EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
    EXPECT_EQ(recording->frame_count(), 0);
    EXPECT_EQ(recording->event_span(), (std::array{10.0, 10.003}));
    EXPECT_THAT(recording->events_in(10.0, 10.0025),
                ElementsAre(Event{1, 1, 10.001, true}, Event{2, 2, 10.001, true},
                            Event{3, 0, 10.0025, false}));
    EXPECT_THAT(recording->events_in(9, 10), ElementsAre(Event{0, 0, 10.0, false}));
    EXPECT_THAT(recording->events_around(10.001, 1, 1),
                ElementsAre(Event{2, 2, 10.001, true}, Event{3, 0, 10.0025, false}));
    EXPECT_THAT(recording->events_in(11, 12), IsEmpty());
    EXPECT_THAT(recording->notes(), IsEmpty());
  }
}

TEST_F(DsecTest, DoesWithoutIndexAndOffsetAndTakesTheSizeOfTheFile) {
  datasets_.erase("ms_to_idx");
  datasets_.erase("t_offset");
  datasets_["events/height"] = {{}, Numbers{3}};
  datasets_["events/width"] = {{}, Numbers{5}};
  const auto told = open();
  EXPECT_EQ(told->size(), (ImageSize{3, 4}));  // the manifest's
  EXPECT_THAT(told->warnings(), ElementsAre(HasSubstr("a sensor of 5x3, the manifest's \"sensor\" "
                                                      "is 4x3, which counts")));
  options_.sensor.reset();
  const auto recording = open();
  EXPECT_EQ(recording->size(), (ImageSize{3, 5}));
  EXPECT_EQ(recording->events_in(0, 1).size(), 4u);
  EXPECT_THAT(recording->warnings(), IsEmpty());
  datasets_["events/width"] = {{}, Numbers{0}};
  refuses("expected a sensor of 1 to");
  datasets_["events/width"] = {{3}, Numbers{5, 5, 5}};
  refuses("expected 1 whole number, got int64 [3]");
}

TEST_F(DsecTest, AssumesASizeThatTheEventsReachOrAsks) {
  struct Case {
    std::int64_t x, y;  // the largest
    std::optional<ImageSize> size;
  };
  constexpr ImageSize kDsec{480, 640};
  options_.sensor.reset();
  for (const auto& [x, y, size] : {Case{639, 479, kDsec},
                                   {346, 0, kDsec},
                                   {0, 260, kDsec},
                                   {344, 259, {}},
                                   {345, 259, ImageSize{260, 346}},
                                   {319, 239, ImageSize{240, 320}},
                                   {319, 238, {}},
                                   {640, 0, {}},
                                   {0, 480, {}},
                                   {1279, 719, ImageSize{720, 1280}},
                                   {1279, 718, {}},
                                   {std::int64_t{1} << 40, 0, {}}}) {
    SCOPED_TRACE(std::to_string(x) + ", " + std::to_string(y));
    datasets_["events/x"] = {{5}, Numbers{0, x, 0, 0, -1}};
    datasets_["events/y"] = {{5}, Numbers{0, 0, y, 0, 0}};
    if (!size) {
      refuses("\"sensor\": {\"width\"");
      continue;
    }
    const auto recording = open();
    EXPECT_EQ(recording->size(), *size);
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr(to_string(*size) + " is assumed")));
  }
  datasets_["events/x"] = {{5}, Numbers{0, 639, 0, 0, 0}};
  for (const char* missing : {"ms_to_idx", "t_offset"}) {  // of another camera's kind
    datasets_.erase(missing);
    refuses("\"sensor\": {\"width\"");
  }
}

TEST_F(DsecTest, TakesTheSizeOfAttributes) {
  struct Case {
    const char* owner;
    testing::Hdf5Dataset width, height;
    const char* fault;
  };
  const testing::Hdf5Dataset three{{}, Numbers{3}}, five{{}, Numbers{5}};
  options_.sensor.reset();
  const auto datasets = datasets_;
  for (const auto& [owner, width, height, fault] : std::vector<Case>{
           {"", five, three, ""},
           {"events", five, three, ""},
           {"", {{1}, std::vector<double>{5}}, {{}, std::vector<std::uint8_t>{3}}, ""},
           {"", {{}, std::vector<double>{5.5}}, three, "1 to 8192 pixels a side, got 5.5x3"},
           {"",
            five,
            {{}, std::vector<double>{std::nan("")}},
            "1 to 8192 pixels a side, got 5xnan"},
           {"events", {{}, Numbers{-5}}, three, "1 to 8192 pixels a side, got -5x3"},
           {"", {{}, Numbers{std::int64_t{1} << 62}}, three, "1 to 8192 pixels a side"},
           {"", {{}, std::vector<std::string>{"5"}}, three, "expected a number, got text [1]"},
           {"events",
            five,
            {{}, std::vector<std::string>{"3"}, 1},
            "expected a number, got text [1]"},
           {"", {{2}, Numbers{5, 5}}, three, "expected a number, got int64 [2]"}}) {
    SCOPED_TRACE(std::string(owner) + fault);
    datasets_ = datasets;
    datasets_[std::string(owner) + "@width"] = width;
    datasets_[std::string(owner) + "@height"] = height;
    if (*fault == '\0') {
      const auto recording = open();
      EXPECT_EQ(recording->size(), (ImageSize{3, 5}));
      EXPECT_THAT(recording->notes(), IsEmpty());
      continue;
    }
    refuses(fault);
    options_.sensor = ImageSize{3, 4};  // which counts
    EXPECT_THAT(open()->warnings(), ElementsAre(HasSubstr(fault)));
    options_.sensor.reset();
  }
}

TEST_F(DsecTest, WindowsThatTouchAFallAreRefusedAlone) {
  datasets_.erase("ms_to_idx");
  datasets_["events/t"] = {{5}, Numbers{0, 1000, 5000, 2000, 6000}};
  const auto recording = open();
  EXPECT_EQ(recording->events_in(9, 10.0015).size(), 2u);
  EXPECT_EQ(recording->events_in(10.005, 11).size(), 1u);
  EXPECT_THROWS(recording->events_in(10.001, 10.0025), InputError,
                "expected times that never decrease", "events.h5 (event 3)");
  EXPECT_EQ(recording->event_span(), (std::array{10.0, 10.006}));
}

TEST_F(DsecTest, WithoutEventsThereIsNoTime) {
  for (const char* name : {"x", "y", "t", "p"}) {
    datasets_[std::string("events/") + name] = {{0}, Numbers{}};
  }
  datasets_["ms_to_idx"] = {{0}, Numbers{}};
  options_.sensor.reset();
  EXPECT_EQ(open()->size(), (ImageSize{480, 640}));
  EXPECT_EQ(open()->event_span(), std::nullopt);
  EXPECT_THAT(open()->events_in(0, 100), IsEmpty());
}

TEST_F(DsecTest, NamesWhatIsWrongWithTheColumns) {
  datasets_["events/x"] = {{4}, Numbers{0, 1, 2, 3}};
  refuses("expected as many numbers as events/t, 5, got int64 [4]");
  datasets_["events/x"] = {{5}, std::vector<double>(5)};
  refuses("expected whole numbers [N], got float64 [5]");
  datasets_["events/x"] = {{5, 1}, Numbers(5)};
  refuses("expected whole numbers [N], got int64 [5, 1]");
  datasets_.erase("events/x");
  refuses("expected a dataset, got none");
}

TEST_F(DsecTest, NamesTheEventThatIsWrong) {
  const auto changed = [&](const char* name, Numbers values, const std::string& what) {
    const auto before = datasets_.at(name);
    datasets_[name] = {{5}, std::move(values)};
    datasets_.erase("ms_to_idx");
    refuses_events(what);
    datasets_[name] = before;
  };
  changed("events/x", {0, 1, 4, 3, 0}, "got x = 4, y = 2");
  changed("events/y", {0, 1, 2, -1, 1}, "got x = 3, y = -1");
  changed("events/p", {0, 1, 2, 0, 1}, "got 2");
  changed("events/t", {0, 3000, 900, 3500, 4000}, "expected times that never decrease");
  changed("events/t", {0, 1000, 1000, 4294967295, 500},
          "expected times that never decrease");  // wrapped
  const std::int64_t most = std::numeric_limits<std::int64_t>::max();
  changed("events/t", {0, 1000, 1000, 2500, most}, "expected a time of fewer than 2^53 us");
}

TEST_F(DsecTest, DoesWithoutAnIndexOfOtherEvents) {
  struct Case {
    testing::Hdf5Dataset index;
    const char* fault;  // empty: it fits
  };
  for (const auto& [index, fault] : std::vector<Case>{
           {{{4}, Numbers{0, 1, 2, 4}},
            "expected the first of 5 events at or after 2 ms, got event 2"},
           {{{4}, Numbers{-1, 0, 2, 3}}, "got event -1"},
           {{{4}, Numbers{0, 1, 3, 6}}, "got event 6"},
           {{{4}, std::vector<double>{0, 1, 3, 4}}, "expected whole numbers [N], got float64 [4]"},
           {{{2, 2}, Numbers{0, 1, 3, 4}}, "expected whole numbers [N], got int64 [2, 2]"},
           {{{1}, std::vector<std::string>{"0"}}, "expected numbers, got text"},
           {{{6}, Numbers{0, 1, 3, 4, 5, 5}}, ""}}) {  // beyond the last event
    SCOPED_TRACE(fault);
    datasets_["ms_to_idx"] = index;
    const auto recording = open();
    EXPECT_EQ(recording->events_in(10.0, 10.0025).size(), 3u);
    if (*fault == '\0') {
      EXPECT_THAT(recording->notes(), IsEmpty());
    } else {
      EXPECT_THAT(recording->notes(),
                  ElementsAre(AllOf(HasSubstr("ms_to_idx does not fit the events and is not used"),
                                    HasSubstr(fault))));
    }
  }
  datasets_["t_offset"] = {{}, Numbers{std::int64_t{1} << 60}};
  refuses("expected an offset of fewer than 2^53 us");
}

TEST_F(DsecTest, MovesEventsByTheRectifyMap) {
  options_.rectify = true;
  refuses("rectify_map.h5");
  // One to the right; the last column leaves the image.
  std::vector<float> places;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      places.push_back(static_cast<float>(x) + 1.4F);
      places.push_back(static_cast<float>(y) - 0.4F);
    }
  }
  const auto map = folder_ / "seq/events/left/rectify_map.h5";
  testing::write_hdf5(map, {{"rectify_map", {{3, 4, 2}, places}}});
  const auto recording = open();
  EXPECT_THAT(
      recording->events_in(10, 11),
      ElementsAre(Event{2, 1, 10.001, true}, Event{3, 2, 10.001, true}, Event{1, 1, 10.003, true}));
  EXPECT_THAT(recording->notes(),
              ElementsAre(HasSubstr("events of 3 of 12 pixels leave the image")));
  places[5] = std::nanf("");
  testing::write_hdf5(map, {{"rectify_map", {{3, 4, 2}, places}}});
  refuses("expected finite places, got others");
  testing::write_hdf5(map, {{"rectify_map", {{4, 3, 2}, places}}});
  refuses("expected float [3, 4, 2], the sensor's size, got float32 [4, 3, 2]");
}

TEST_F(DsecTest, HasFramesWhereTheyAreOfTheEventsView) {
  write_images("rectified", {3, 4}, 2);
  auto recording = open();
  EXPECT_EQ(recording->frame_count(), 0);
  EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("not of the events' view")));
  write_images("distorted", {3, 4}, 2);
  EXPECT_THROWS(open(), InputError, "images/timestamps.txt");
  testing::write_file(folder_ / "seq/images/timestamps.txt", "10000000\n10002500\n");
  recording = open();
  ASSERT_EQ(recording->frame_count(), 2);
  EXPECT_EQ(recording->frame_time_s(1), 10.0025);
  EXPECT_THAT(recording->frame(1).pixels, ::testing::Each(10));
  EXPECT_EQ(recording->events_between(0, 1).size(), 3u);
  for (const char* lines : {"10000000\n10002500\n10002501\n", "10000000\n"}) {
    testing::write_file(folder_ / "seq/images/timestamps.txt", lines);
    EXPECT_THROWS(open(), InputError, "expected a time for each of 2 images, got ");
  }
  testing::write_file(folder_ / "seq/images/timestamps.txt", "10000000\n10.5\n");
  EXPECT_THROWS(open(), InputError, "timestamps.txt (line 2)");
  write_images("distorted", {6, 8}, 2);
  EXPECT_THAT(open()->notes(),
              ElementsAre(HasSubstr("expected images of 4x3 as the events', got 8x6")));
  EXPECT_EQ(open()->frame_count(), 0);
}

TEST(M3edTest, HasTheSizeInTheFileAndTwoCameras) {
  const testing::TemporaryFolder folder;
  std::map<std::string, testing::Hdf5Dataset> datasets;
  for (const std::string camera : {"left", "right"}) {
    const std::string group = "prophesee/" + camera + "/";
    datasets[group + "x"] = {{2}, Numbers{0, camera == "left" ? 1 : 3}};
    datasets[group + "y"] = {{2}, Numbers{2, 2}};
    datasets[group + "t"] = {{2}, Numbers{100, 1500}};
    datasets[group + "p"] = {{2}, Numbers{1, 0}};
    datasets[group + "ms_map_idx"] = {{2}, Numbers{0, 1}};
    datasets[group + "calib/resolution"] = {{2}, Numbers{4, 3}};
  }
  testing::write_hdf5(folder / "m.h5", datasets);
  EXPECT_EQ(find_recording_format(folder / "m.h5"), RecordingFormat::kM3ed);
  RecordingOptions options;
  for (const char* camera : {"left", "right"}) {
    options.camera = camera;
    const auto recording = open_recording(folder / "m.h5", RecordingFormat::kM3ed, options);
    EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
    EXPECT_EQ(recording->events_in(0, 1).at(1),
              (Event{options.camera == "left" ? 1 : 3, 2, 0.0015, false}));
  }
  datasets.erase("prophesee/right/calib/resolution");
  testing::write_hdf5(folder / "m.h5", datasets);
  EXPECT_THROWS(open_m3ed_recording(folder / "m.h5", options), InputError,
                "expected the sensor's size");
}

}  // namespace
}  // namespace eventgan

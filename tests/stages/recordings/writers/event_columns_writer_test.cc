#include "stages/recordings/writers/event_columns_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/hdf5/hdf5.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr ImageSize kOfColumns{4, 6};

/// The times of the example in the comments of DSEC's EventSlicer.
constexpr std::array<std::int64_t, 10> kTimes_us{0,    500,  2100, 5000, 5000,
                                                 7100, 7200, 7200, 8100, 9000};

std::vector<StampedEvent> example(std::int64_t offset_us) {
  std::vector<StampedEvent> events;
  for (const std::int64_t time_us : kTimes_us) events.push_back({offset_us + time_us, 5, 3, false});
  return events;
}

template <class Number>
std::vector<Number> numbers(const std::filesystem::path& file, const std::string& path) {
  const Hdf5Lock lock;
  const Hdf5Handle opened = open_hdf5_file(file);
  const Hdf5Handle dataset = open_object(opened, path);
  Dims dims = dims_of(dataset, path);
  std::vector<Number> values(element_count(dims));
  if (!values.empty()) {
    read_block(dataset, path, Dims(dims.size(), 0), dims, element_type<Number>(), values.data());
  }
  return values;
}

TEST(EventColumnsWriter, IndexesEachMillisecondAsDsecDoes) {
  const testing::TemporaryFolder folder;
  constexpr std::int64_t kOffset_us = 1'600'000'000'000'123;
  EventColumnsWriter writer(folder / "events.h5", ColumnFile::kDsec, kOfColumns, kOffset_us);
  writer.add_events(example(kOffset_us));
  writer.commit(kOffset_us + 10'400);
  // The example's, and behind the last event the number of events: until 11 ms, where 10.4 ms end.
  EXPECT_EQ(numbers<std::uint64_t>(folder / "events.h5", "ms_to_idx"),
            (std::vector<std::uint64_t>{0, 2, 2, 3, 3, 3, 5, 5, 8, 9, 10, 10}));
  EXPECT_EQ(numbers<std::uint32_t>(folder / "events.h5", "events/t"),
            std::vector<std::uint32_t>(kTimes_us.begin(), kTimes_us.end()));
  EXPECT_EQ(numbers<std::uint16_t>(folder / "events.h5", "events/x"),
            std::vector<std::uint16_t>(kTimes_us.size(), 5));
  EXPECT_EQ(numbers<std::uint8_t>(folder / "events.h5", "events/p"),
            std::vector<std::uint8_t>(kTimes_us.size(), 0));
  const Hdf5Lock lock;
  const Hdf5Handle file = open_hdf5_file(folder / "events.h5");
  EXPECT_EQ(read_number_attribute(file, "height"), 4);
  EXPECT_EQ(read_number_attribute(file, "width"), 6);
}

TEST(EventColumnsWriter, OfProphesee) {
  const testing::TemporaryFolder folder;
  EventColumnsWriter writer(folder / "a_td.h5", ColumnFile::kProphesee, kOfColumns);
  writer.add_events(example(5'000'000'000));
  writer.commit(6'000'000'000);
  EXPECT_EQ(numbers<std::int64_t>(folder / "a_td.h5", "events/t").back(), 5'000'009'000);
  const Hdf5Lock lock;
  const Hdf5Handle file = open_hdf5_file(folder / "a_td.h5");
  const Hdf5Handle height = open_object(file, "events/height");
  EXPECT_EQ(read_elements<std::int64_t>(height, "height", element_type<std::int64_t>()),
            std::vector<std::int64_t>{4});
  EXPECT_TRUE(dims_of(height, "height").empty());
}

TEST(EventColumnsWriter, BytesDoNotDependOnThePortions) {
  const testing::TemporaryFolder folder;
  for (const std::size_t portion : {1u, 3u, 10u}) {
    EventColumnsWriter writer(folder / std::to_string(portion), ColumnFile::kDsec, kOfColumns);
    const std::vector<StampedEvent> events = example(0);
    for (std::size_t first = 0; first < events.size(); first += portion) {
      const std::size_t count = std::min(portion, events.size() - first);
      writer.add_events(std::span(events).subspan(first, count));
    }
    writer.commit(9'000);
  }
  EXPECT_EQ(testing::read_file(folder / "1"), testing::read_file(folder / "10"));
  EXPECT_EQ(testing::read_file(folder / "3"), testing::read_file(folder / "10"));
}

TEST(EventColumnsWriter, NoEventsAndNoTime) {
  const testing::TemporaryFolder folder;
  EventColumnsWriter writer(folder / "e.h5", ColumnFile::kDsec, {1, 1});
  writer.commit(0);
  EXPECT_EQ(numbers<std::uint64_t>(folder / "e.h5", "ms_to_idx"), std::vector<std::uint64_t>{0});
  EXPECT_TRUE(numbers<std::uint32_t>(folder / "e.h5", "events/t").empty());
}

TEST(EventColumnsWriter, RefusesWhatBreaksItsRules) {
  const testing::TemporaryFolder folder;
  constexpr std::int64_t kBeyond = std::int64_t{std::numeric_limits<std::uint32_t>::max()} + 1;
  for (const ImageSize size : {ImageSize{0, 1}, {1, 65537}}) {
    EXPECT_THROWS(EventColumnsWriter(folder / "a", ColumnFile::kDsec, size), std::invalid_argument,
                  "expected an image size of 1x1 to 65536x65536");
  }
  EventColumnsWriter writer(folder / "a", ColumnFile::kDsec, kOfColumns, 100);
  const auto add = [&](StampedEvent event) { writer.add_events(std::span(&event, 1)); };
  const auto refuses = [&](StampedEvent event, const char* words) {
    EXPECT_THROWS(add(event), std::invalid_argument, words);
  };
  refuses({99, 0, 0, true}, "events in time order, not before the recording's begin");
  refuses({100, 6, 0, true}, "expected events within the size");
  refuses({100, 0, 4, true}, "expected events within the size");
  refuses({100 + kBeyond, 0, 0, true}, "expected events within 2^32 microseconds");
  add({200, 0, 0, true});
  refuses({199, 0, 0, true}, "expected events in time order");
  EXPECT_THROWS(writer.commit(199), std::invalid_argument, "an end that is not before the last");
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  writer.commit(200);
  EXPECT_EQ(numbers<std::uint32_t>(folder / "a", "events/t"), std::vector<std::uint32_t>{100});
}

TEST(RectifyMap, HasEachPixelAtItsPlace) {
  const testing::TemporaryFolder folder;
  write_rectify_map(folder / "m.h5", {2, 3});
  EXPECT_EQ(numbers<float>(folder / "m.h5", "rectify_map"),
            (std::vector<float>{0, 0, 1, 0, 2, 0, 0, 1, 1, 1, 2, 1}));
}

}  // namespace
}  // namespace eventgan

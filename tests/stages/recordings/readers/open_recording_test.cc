#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "stages/recordings/readers/recording.h"
#include "tests/stages/recordings/small_recording.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

RecordingOptions right_camera() {
  RecordingOptions options;
  options.camera = "right";
  return options;
}

TEST(OpenRecordingTest, OpensTheRightCameraAndTheAuthorsLayout) {
  const testing::TemporaryFolder folder;
  const std::map<std::string, testing::Hdf5Dataset> left = testing::small_mvsec();
  std::map<std::string, testing::Hdf5Dataset> right;
  for (const auto& [name, dataset] : left) right["davis/right" + name.substr(10)] = dataset;
  testing::write_hdf5(folder / "right.h5", right);
  testing::write_hdf5(
      folder / "authors.h5",
      {{"davis/events/data", left.at("davis/left/events")},
       {"davis/image_raw/data", left.at("davis/left/image_raw")},
       {"davis/image_raw/timestamps", left.at("davis/left/image_raw_ts")},
       {"davis/image_raw/event_index", left.at("davis/left/image_raw_event_inds")}});
  const auto camera = open_recording(folder / "right.h5", RecordingFormat::kMvsec, right_camera());
  const auto authors = open_recording(folder / "authors.h5", RecordingFormat::kEventgan);
  EXPECT_EQ(camera->events_between(0, 2), authors->events_between(0, 2));
  EXPECT_TRUE(camera->flow(0).has_value());
  EXPECT_FALSE(authors->flow(0).has_value());
}

TEST(OpenRecordingTest, GivesTheSameForSliderDepthInTwoLayouts) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto ecd = open_recording(data / "davis" / "slider_depth", RecordingFormat::kEcd);
  const auto mvsec =
      open_recording(data / "davis" / "slider_depth_mvsec_layout.hdf5", RecordingFormat::kMvsec);
  for (const Recording* recording : {ecd.get(), mvsec.get()}) {
    EXPECT_EQ(recording->size(), (ImageSize{180, 240}));
    ASSERT_EQ(recording->frame_count(), 3);
    EXPECT_EQ(recording->events_between(0, 1).size(), 7778u);
    EXPECT_EQ(recording->events_between(1, 2).size(), 11318u);
    EXPECT_EQ(recording->events_between(0, 2).size(), 7778u + 11318u);
  }
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(ecd->frame_time_s(i), mvsec->frame_time_s(i));
    EXPECT_EQ(ecd->frame(i), mvsec->frame(i));
  }
  EXPECT_EQ(ecd->events_between(0, 2), mvsec->events_between(0, 2));
}

TEST(OpenRecordingTest, ReadsARecordingOfADavis346) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto recording =
      open_recording(data / "davis" / "davis346_eventgan_layout.hdf5", RecordingFormat::kEventgan);
  EXPECT_EQ(recording->size(), (ImageSize{260, 346}));
  ASSERT_EQ(recording->frame_count(), 3);
  // Its event_index 4703, 45447, 78074 is that of the first event at or after each frame; the first
  // two of these events are at the frame's own time, so they count as before it.
  EXPECT_EQ(recording->events_between(0, 1).size(), 45448u - 4704u);
  EXPECT_EQ(recording->events_between(1, 2).size(), 78074u - 45448u);
  const GreyImage frame = recording->frame(2);
  EXPECT_GT(std::ranges::max(frame.pixels), std::ranges::min(frame.pixels) + 50);
}

// Many threads on one recording and on several.
TEST(OpenRecordingTest, IsReadByManyThreads) {
  const testing::TemporaryFolder folder;
  testing::write_hdf5(folder / "small.h5", testing::small_mvsec());
  const auto shared = open_recording(folder / "small.h5", RecordingFormat::kMvsec);
  std::atomic<int> wrong = 0;
  const auto read = [&] {
    for (int i = 0; i < 30; ++i) {
      const auto own = open_recording(folder / "small.h5", RecordingFormat::kMvsec);
      for (const Recording* recording : {shared.get(), own.get()}) {
        wrong += recording->events_between(0, 2).size() != 4;
        wrong += recording->events_between(i % 2, i % 2 + 1).size() != 2;
        wrong += recording->frame(i % 3).pixels[11] != 10 * (i % 3 + 1);
        wrong += recording->flow(1)->x_px[0] != 2.0f;
      }
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 6; ++i) threads.emplace_back(read);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(FindRecordingFormat, TellsByWhatIsThere) {
  const testing::TemporaryFolder folder;
  testing::write_hdf5(folder / "m.h5", testing::small_mvsec());
  EXPECT_EQ(find_recording_format(folder / "m.h5"), RecordingFormat::kMvsec);
  EXPECT_EQ(find_recording_format(folder / "m.h5", right_camera()), std::nullopt);
  testing::write_hdf5(folder / "e.h5", {{"davis/events/data", {{0, 4}, std::vector<double>{}}}});
  EXPECT_EQ(find_recording_format(folder / "e.h5"), RecordingFormat::kEventgan);
  testing::write_file(folder / "ecd/events.txt", "");
  EXPECT_EQ(find_recording_format(folder / "ecd"), RecordingFormat::kEcd);
  EXPECT_EQ(find_recording_format(folder / "ecd/events.txt"), RecordingFormat::kEcd);
  EXPECT_EQ(event_file(folder / "ecd"), folder / "ecd/events.txt");
  EXPECT_THAT(event_companions(folder / "ecd/events.txt"),
              ::testing::ElementsAre(folder / "ecd/images.txt"));
  std::filesystem::create_directories(folder / "seq/events/left");
  const auto columns = folder / "seq/events/left/events.h5";
  testing::write_hdf5(columns, {{"events/t", {{1}, std::vector<std::int64_t>{0}}}});
  for (const auto& path : {folder / "seq", columns}) {
    EXPECT_EQ(find_recording_format(path), RecordingFormat::kDsec);
    EXPECT_EQ(event_file(path), columns);
  }
  EXPECT_EQ(find_recording_format(folder / "seq", right_camera()), std::nullopt);
  EXPECT_THAT(event_companions(columns), ::testing::IsEmpty());
  testing::write_file(folder / "seq/images/timestamps.txt", "");
  RecordingOptions rectified;
  rectified.rectify = true;
  EXPECT_THAT(event_companions(columns, RecordingFormat::kDsec, rectified),
              ::testing::ElementsAre(folder / "seq/events/left/rectify_map.h5",
                                     folder / "seq/images/timestamps.txt"));
  testing::write_file(folder / "events.csv", "t,x,y,p\n");
  EXPECT_EQ(find_recording_format(folder / "events.csv"), RecordingFormat::kTable);
  EXPECT_EQ(event_file(folder / "events.csv"), folder / "events.csv");
  testing::write_file(folder / "text", "text");
  EXPECT_EQ(find_recording_format(folder / "text"), std::nullopt);
  EXPECT_EQ(find_recording_format(folder.path()), std::nullopt);
  EXPECT_EQ(find_recording_format(folder / "absent"), std::nullopt);
}

}  // namespace
}  // namespace eventgan

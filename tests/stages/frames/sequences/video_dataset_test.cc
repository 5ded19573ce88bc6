#include "stages/frames/sequences/video_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using State = Neighbour::State;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

/// clip.avi: seven grey frames at 20 Hz.
class VideoDatasetTest : public ::testing::Test {
 protected:
  VideoDatasetTest() {
    spec_.root = "v/clip.avi";
    std::filesystem::create_directory(folder_ / "v");
    cv::VideoWriter writer((folder_ / "v/clip.avi").string(), cv::CAP_OPENCV_MJPEG,
                           cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20, cv::Size(32, 16));
    for (int i = 0; i < 7; ++i) writer.write(cv::Mat(16, 32, CV_8UC3, cv::Scalar::all(30 * i)));
  }
  std::unique_ptr<Dataset> open() const { return open_video_dataset(spec_, folder_.path()); }

  testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

TEST_F(VideoDatasetTest, EveryFrameIsASample) {
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 7u);
  const LabelledFrame& frame = dataset->labelled_frames()[5];
  EXPECT_EQ(frame.sample_id, "clip/000005");
  EXPECT_EQ(frame.sequence, "clip");
  EXPECT_EQ(frame.frame, (FrameRef{"v/clip.avi", 5, 5}));
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 5.0 / 20);
  EXPECT_EQ(dataset->neighbour(frame, 0).frame, frame.frame);
  EXPECT_EQ(dataset->neighbour(frame, 1).frame, (FrameRef{"v/clip.avi", 6, 6}));
  EXPECT_EQ(dataset->neighbour(frame, 2).state, State::kBeyond);
  EXPECT_EQ(dataset->neighbour(frame, -5).frame, (FrameRef{"v/clip.avi", 0, 0}));
  EXPECT_EQ(dataset->neighbour(frame, -6).state, State::kBeyond);
  EXPECT_EQ(std::get<Annotation>(dataset->annotation(frame.label_key)), Annotation{});
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(VideoDatasetTest, TheManifestsRateGoesBeforeTheContainers) {
  spec_.frames_per_second = 50;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[5].frame.time_s, 5.0 / 50);
}

TEST_F(VideoDatasetTest, FramesThatComeUnevenlyHaveTheirOwnTimes) {
  testing::write_timed_video(folder_ / "v/uneven.mkv", {0, 100, 600, 700, 1200});
  spec_.root = "v/uneven.mkv";
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 5u);
  const double steps_s[] = {0.1, 0.5, 0.1, 0.5};
  for (std::size_t i = 1; i < 5; ++i) {
    const FramePair pair{dataset->neighbour(frames[i], -1).frame, frames[i].frame};
    EXPECT_NEAR(pair.gap_s(), steps_s[i - 1], 1e-9);
  }
  spec_.frames_per_second = 10;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[4].frame.time_s, 0.4);
}

TEST_F(VideoDatasetTest, NotesTimesThatDoNotAscend) {
  testing::write_timed_video(folder_ / "v/stuck.mkv", {0, 100, 100, 200});
  spec_.root = "v/stuck.mkv";
  EXPECT_THAT(open()->notes(), ElementsAre(HasSubstr("the times of the frames do not ascend")));
}

TEST_F(VideoDatasetTest, NotesAFileCutShort) {
  EXPECT_THAT(open()->notes(), IsEmpty());
  const auto file = folder_ / spec_.root;
  const std::string bytes = testing::read_file(file);
  testing::write_file(file, bytes.substr(0, bytes.size() * 3 / 4));
  EXPECT_LT(open()->labelled_frames().size(), 6u);
  EXPECT_THAT(open()->notes(), ElementsAre(AllOf(HasSubstr(" of about 7 announced frames"),
                                                 HasSubstr("v/clip.avi"))));
}

TEST_F(VideoDatasetTest, PassesLabelsThrough) {
  testing::write_file(folder_ / "v/clip.json", R"({"2": {"k": [1, 2]}, "7": 1, "9": 2})");
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_EQ(std::get<Annotation>(dataset->annotation(frames[2].label_key)).original,
            R"({"k":[1,2]})");
  EXPECT_EQ(std::get<Annotation>(dataset->annotation(frames[3].label_key)).original, "");
  EXPECT_TRUE(is_fault(dataset->annotation("4")));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("v/clip.json"));
  EXPECT_EQ(dataset->label_place(frames[2].label_key), "v/clip.json#2");
  EXPECT_EQ(dataset->label_place(frames[3].label_key), "v/clip.avi");
  EXPECT_THAT(dataset->notes(),
              ElementsAre("2 labels for frames beyond the video's 7 left out, in v/clip.json"));
}

TEST_F(VideoDatasetTest, ALabelFilesExtensionMayBeInCapitals) {
  testing::write_file(folder_ / "v/clip.JSON", R"({"2": "two"})");
  EXPECT_THAT(open()->annotation_files(), ElementsAre("v/clip.JSON"));
  EXPECT_EQ(std::get<Annotation>(open()->annotation("2")).original, "\"two\"");
  testing::write_file(folder_ / "v/clip.json", "{}");
  EXPECT_THAT(open()->annotation_files(), ElementsAre("v/clip.JSON"));
  EXPECT_THAT(open()->notes(),
              ElementsAre("1 labels left out, since v/clip.JSON counts: clip.json"));
}

TEST_F(VideoDatasetTest, AManifestNamedAsTheVideoHoldsNoLabels) {
  testing::write_file(folder_ / "v/clip.json", R"({"format": "eventgan-manifest", "version": 1})");
  EXPECT_THAT(open()->annotation_files(), IsEmpty());
  testing::write_file(folder_ / "v/clip.json", R"({"format": "other"})");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(AllOf(
                                   HasSubstr("expected a frame number, got \"format\", in "),
                                   HasSubstr("v/clip.json (taken as the labels of v/clip.avi)"))));
}

TEST_F(VideoDatasetTest, RefusesWhatIsNoVideo) {
  testing::write_file(folder_ / "v/clip.avi", "no video at all");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("v/clip.avi")));
}

TEST(IsVideoName, GoesByTheExtension) {
  for (const char* name : {"a.mp4", "a.b.AVI", "x/a.mov", "a.Mkv"})
    EXPECT_TRUE(is_video_name(name));
  for (const char* name : {"a.png", "mp4", "a.mp4.txt", ""}) EXPECT_FALSE(is_video_name(name));
}

TEST(VideoDatasetOnSharedData, CountsTheFramesOfAClip) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.root = "clips/01_dog.mp4";
  const auto dataset = open_video_dataset(spec, data);
  ASSERT_EQ(dataset->labelled_frames().size(), 289u);
  EXPECT_EQ(dataset->labelled_frames().back().sample_id, "01_dog/000288");
  EXPECT_NEAR(dataset->labelled_frames()[30].frame.time_s, 30 * 1001.0 / 30000, 1e-9);  // 29.97 Hz
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

}  // namespace
}  // namespace eventgan

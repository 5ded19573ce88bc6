
#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "stages/frames/decoding/video_clip.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

extern "C" {
#include <libavcodec/packet.h>
#include <libavformat/avformat.h>
}

namespace eventgan {
namespace {

class VideoClipTest : public FolderTest {
 protected:
  /// A video whose frames are shown at these times.
  VideoClip timed(const std::vector<int>& times_ms) const {
    testing::write_timed_video(at("clip.mkv"), times_ms);
    return measure_video(at("clip.mkv"));
  }
};

TEST_F(VideoClipTest, CountsToTheEndOrAsFarAsIsEnough) {
  testing::write_counting_video(at("clip.avi"), 12);
  const VideoClip whole = measure_video(at("clip.avi")), part = measure_video(at("clip.avi"), 5);
  EXPECT_EQ(whole.frame_count, 12);
  EXPECT_EQ(whole.frames_per_second, 25);
  EXPECT_EQ(part.frame_count, 5);
  EXPECT_EQ(part.frames_per_second, 25);
  EXPECT_EQ(part.announced_count, whole.announced_count);
  EXPECT_EQ(measure_video(at("clip.avi"), 13).frame_count, 12);
}

TEST_F(VideoClipTest, KeepsTheTimesOfFramesThatComeUnevenly) {
  const VideoClip clip = timed({40, 140, 640, 740, 1240, 1340});
  EXPECT_EQ(clip.frame_count, 6);
  const double expected[] = {0, 0.1, 0.6, 0.7, 1.2, 1.3};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(clip.time_s(i), expected[i], 1e-9);
  EXPECT_NEAR(measure_video(at("clip.mkv"), 3).time_s(2), 0.6, 1e-9);
}

TEST_F(VideoClipTest, TimesRoundedToMillisecondsAreThoseOfTheRate) {
  std::vector<int> thirds;  // 30 Hz, as Matroska has it
  for (int i = 0; i < 31; ++i) thirds.push_back((i * 1000 + 15) / 30);
  const VideoClip clip = timed(thirds);
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_DOUBLE_EQ(clip.time_s(10), 10 / *clip.frames_per_second);
  EXPECT_NEAR(clip.time_s(30), 1, 2e-3);
}

TEST_F(VideoClipTest, TimesThatDoNotAscendAreNotTaken) {
  const VideoClip clip = timed({0, 100, 100, 100, 500});
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_FALSE(clip.times_ascend);
}

/// Copies a video's packets to a file in which its i-th frame is shown at times_ms[i].
void copy_retimed(const fs::path& from, const fs::path& to, const std::vector<int>& times_ms) {
  AVFormatContext* in = nullptr;
  AVFormatContext* out = nullptr;
  ASSERT_EQ(avformat_open_input(&in, from.c_str(), nullptr, nullptr), 0);
  ASSERT_GE(avformat_alloc_output_context2(&out, nullptr, nullptr, to.c_str()), 0);
  out->avoid_negative_ts = 0;  // what is shown before 0 is not shown: MP4 has an edit list then
  AVStream* const stream = avformat_new_stream(out, nullptr);
  avcodec_parameters_copy(stream->codecpar, in->streams[0]->codecpar);
  stream->codecpar->codec_tag = 0;
  ASSERT_GE(avio_open(&out->pb, to.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(out, nullptr), 0);
  std::vector<AVPacket*> packets;
  std::vector<std::int64_t> order;
  for (;;) {
    AVPacket* packet = av_packet_alloc();
    if (av_read_frame(in, packet) < 0) {
      av_packet_free(&packet);
      break;
    }
    order.push_back(packet->pts);
    packets.push_back(packet);
  }
  EXPECT_FALSE(std::ranges::is_sorted(order)) << "frames in the order in which they are shown";
  std::ranges::sort(order);
  ASSERT_EQ(order.size(), times_ms.size());
  std::size_t place = 0;
  for (AVPacket* packet : packets) {
    const auto shown_as = std::ranges::lower_bound(order, packet->pts) - order.begin();
    packet->pts = times_ms[static_cast<std::size_t>(shown_as)];
    packet->dts = times_ms[place++] - 200;  // each before it is shown
    packet->duration = 40;
    av_packet_rescale_ts(packet, {1, 1000}, stream->time_base);
    ASSERT_GE(av_write_frame(out, packet), 0);
    av_packet_free(&packet);
  }
  av_write_trailer(out);
  avio_closep(&out->pb);
  avformat_free_context(out);
  avformat_close_input(&in);
}

// H.264 stores frames in another order than they are shown in; the decoder gives the last ones
// when the file has ended.
TEST_F(VideoClipTest, FramesStoredInAnotherOrderHaveTheirOwnTimes) {
  constexpr int kFrames = 30;
  {
    cv::VideoWriter writer((at("even.mp4")).string(), cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc('a', 'v', 'c', '1'), 25, cv::Size(64, 48));
    if (!writer.isOpened()) GTEST_SKIP() << "skipped: no H.264 encoder";
    for (int i = 0; i < kFrames; ++i)
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(2 * i)));
  }
  const VideoClip even = measure_video(at("even.mp4"));
  EXPECT_EQ(even.frame_count, kFrames);
  EXPECT_TRUE(even.times_ascend);
  EXPECT_TRUE(even.uneven_times_s.empty());

  std::vector<int> times_ms;  // steps of 20, 40 and 100 ms by turns
  for (int i = 0; i < kFrames; ++i) {
    const int steps_ms[] = {0, 20, 60};
    times_ms.push_back(i / 3 * 160 + steps_ms[i % 3]);
  }
  copy_retimed(at("even.mp4"), at("uneven.mkv"), times_ms);
  const VideoClip uneven = measure_video(at("uneven.mkv"));
  ASSERT_EQ(uneven.frame_count, kFrames);
  ASSERT_EQ(uneven.uneven_times_s.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) EXPECT_NEAR(uneven.time_s(i), times_ms[i] / 1000.0, 1e-9) << i;

  // A clock that begins at 5 s, and a cut without decoding, whose first five frames are not shown.
  for (const auto& [name, start_ms, shown] :
       {std::tuple("late.mkv", 5000, kFrames), std::tuple("cut.mp4", -200, kFrames - 5)}) {
    for (int i = 0; i < kFrames; ++i) times_ms[i] = start_ms + 40 * i;
    copy_retimed(at("even.mp4"), at(name), times_ms);
    const VideoClip clip = measure_video(at(name));
    EXPECT_EQ(clip.frame_count, shown) << name;
    EXPECT_EQ(clip.announced_count, shown) << name;
  }
}

TEST_F(VideoClipTest, RefusesWhatIsNoVideo) {
  EXPECT_THROWS(measure_video(at("none.avi")), InputError, "none.avi");
  write("words.avi", "words");
  EXPECT_THROWS(measure_video(at("words.avi"), 1), InputError, "expected a video", "words.avi");
}

class VideoLabelsTest : public FolderTest {
 protected:
  std::optional<VideoLabels> read(const std::string& text) const {
    write("clip.json", text);
    return read_video_labels(at("clip.json"), "clip.mp4");
  }
};

TEST_F(VideoLabelsTest, GivesEachFrameItsCompactText) {
  EXPECT_THAT(
      read(R"({ "10": { "b": 1, "a": [ 1.5 ] }, "000002": null, "0": "x" })"),
      Optional(ElementsAre(Pair(0, "\"x\""), Pair(2, "null"), Pair(10, R"({"b":1,"a":[1.5]})"))));
  EXPECT_THAT(read("{}"), Optional(IsEmpty()));
  EXPECT_THAT(read("{\"1\": 5 // five\n}"), Optional(ElementsAre(Pair(1, "5"))));
}

TEST_F(VideoLabelsTest, AManifestHoldsNoLabels) {
  EXPECT_EQ(read("// comments are allowed\n{\"name\": \"x\", \"format\": \"eventgan-manifest\"}"),
            std::nullopt);
}

TEST_F(VideoLabelsTest, RefusesMalformedFiles) {
  const std::pair<std::string, const char*> bad[] = {
      {"", "expected a JSON object"},
      {"[1]", "got array"},
      {R"({"a": 1})", "got \"a\""},
      {R"({"format": "other"})", "got \"format\""},
      {R"({"format": 1})", "got \"format\""},
      {R"({"-1": 1})", "got \"-1\""},
      {R"({"1.5": 1})", "got \"1.5\""},
      {R"({"": 1})", "got \"\""},
      {R"({"1": 1, "01": 2})", "frame 1 twice"},
      {R"({"1": 1, "1": 2})", "$.1: expected the key once"},
      {R"({"1": {"a": 1, "a": 2}})", ".a: expected the key once"},
      {"{\"1\": " + std::string(100'000, '[') + std::string(100'000, ']') + "}",
       "levels of nesting"}};
  for (const auto& [text, message] : bad) {
    EXPECT_THROWS(read(text), InputError, message, "clip.json (taken as the labels of clip.mp4)")
        << text.substr(0, 100);
  }
}

TEST_F(VideoLabelsTest, OfManyFramesAreReadInNoTime) {
  std::string text = "{";
  for (int i = 0; i < 200'000; ++i) text += (i == 0 ? "\"" : ",\"") + std::to_string(i) + "\":0";
  EXPECT_EQ(read(text + "}")->size(), 200'000u);
}

/// clip.avi: seven grey frames at 20 Hz.
class VideoDatasetTest : public FolderTest {
 protected:
  VideoDatasetTest() {
    spec_.root = "v/clip.avi";
    fs::create_directory(at("v"));
    cv::VideoWriter writer(at("v/clip.avi").string(), cv::CAP_OPENCV_MJPEG,
                           cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 20, cv::Size(32, 16));
    for (int i = 0; i < 7; ++i) writer.write(cv::Mat(16, 32, CV_8UC3, cv::Scalar::all(30 * i)));
  }
  std::unique_ptr<Dataset> open() const { return open_frames_dataset(spec_, folder_.path()); }
  /// Opens a video whose frames are shown at these times.
  std::unique_ptr<Dataset> open_timed(const std::vector<int>& times_ms, int duration_s = 0) {
    spec_.root = "v/timed.mkv";
    testing::write_timed_video(at(spec_.root), times_ms, duration_s);
    return open();
  }

  SourceSpec spec_;
};

TEST_F(VideoDatasetTest, EveryFrameIsASample) {
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 7u);
  const LabelledFrame& frame = dataset->labelled_frames()[5];
  EXPECT_EQ(text_of(frame), "clip/000005 of clip: v/clip.avi 5 by clip/");
  EXPECT_EQ(frame.frame.video_frame, 5);
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 5.0 / 20);
  EXPECT_THAT(paired(*dataset, 5, {-6, -5, 0, 1, 2}),
              ElementsAre("beyond", "present v/clip.avi 0", "present v/clip.avi 5",
                          "present v/clip.avi 6", "beyond"));
  EXPECT_EQ(dataset->paired_frame(frame, -5).frame.video_frame, 0);
  EXPECT_EQ(annotation_of(*dataset, 5), Annotation{});
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(VideoDatasetTest, TheManifestsRateGoesBeforeTheContainers) {
  spec_.frames_per_second = 50;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[5].frame.time_s, 5.0 / 50);
}

TEST_F(VideoDatasetTest, FramesThatComeUnevenlyHaveTheirOwnTimes) {
  const auto dataset = open_timed({0, 100, 600, 700, 1200});
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 5u);
  const double steps_s[] = {0.1, 0.5, 0.1, 0.5};
  for (std::size_t i = 1; i < 5; ++i) {
    const FramePair pair{dataset->paired_frame(frames[i], -1).frame, frames[i].frame};
    EXPECT_NEAR(pair.gap_s(), steps_s[i - 1], 1e-9);
  }
  spec_.frames_per_second = 10;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[4].frame.time_s, 0.4);
}

TEST_F(VideoDatasetTest, FramesThatComeUnevenlyAreNotCutShortIfTheyLastAsLong) {
  std::vector<int> times_ms;
  for (int i = 0; i < 24; ++i) times_ms.push_back(100 * (i + 3 * (i / 4)));  // up to 3.8 s
  EXPECT_THAT(open_timed(times_ms, 4)->notes(), IsEmpty());
  EXPECT_THAT(open_timed(times_ms, 8)->notes(),
              ElementsAre(HasSubstr("the file may be cut short")));
}

TEST_F(VideoDatasetTest, NotesTimesThatDoNotAscend) {
  EXPECT_THAT(open_timed({0, 100, 100, 200})->notes(),
              ElementsAre(HasSubstr("the times of the frames do not ascend")));
}

TEST_F(VideoDatasetTest, NotesAFileCutShort) {
  EXPECT_THAT(open()->notes(), IsEmpty());
  const std::string bytes = read_file(at(spec_.root));
  write(spec_.root, bytes.substr(0, bytes.size() * 3 / 4));
  EXPECT_LT(open()->labelled_frames().size(), 6u);
  EXPECT_THAT(open()->notes(), ElementsAre(AllOf(HasSubstr(" of about 7 announced frames"),
                                                 HasSubstr("v/clip.avi"))));
}

TEST_F(VideoDatasetTest, PassesLabelsThrough) {
  write("v/clip.json", R"({"2": {"k": [1, 2]}, "7": 1, "9": 2})");
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_EQ(annotation_of(*dataset, 2).original, R"({"k":[1,2]})");
  EXPECT_EQ(annotation_of(*dataset, 3).original, "");
  EXPECT_THAT(fault_of(dataset->annotation("clip/4")), HasSubstr("expected"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("v/clip.json"));
  EXPECT_EQ(dataset->label_place(frames[2].label_key), "v/clip.json#2");
  EXPECT_EQ(dataset->label_place(frames[3].label_key), "v/clip.avi");
  EXPECT_THAT(dataset->notes(),
              ElementsAre("2 labels for frames beyond the video's 7 left out, in v/clip.json"));
}

TEST_F(VideoDatasetTest, ALabelFilesExtensionMayBeInCapitals) {
  write("v/clip.JSON", R"({"2": "two"})");
  EXPECT_THAT(open()->annotation_files(), ElementsAre("v/clip.JSON"));
  EXPECT_EQ(open()->annotation("clip/2")->original, "\"two\"");
  write("v/clip.json", "{}");
  EXPECT_THAT(open()->annotation_files(), ElementsAre("v/clip.JSON"));
  EXPECT_THAT(open()->notes(),
              ElementsAre("a file of labels left out, since v/clip.JSON counts: clip.json"));
}

TEST_F(VideoDatasetTest, AManifestNamedAsTheVideoHoldsNoLabels) {
  write("v/clip.json", R"({"format": "eventgan-manifest", "version": 1})");
  EXPECT_THAT(open()->annotation_files(), IsEmpty());
  write("v/clip.json", R"({"format": "other"})");
  EXPECT_THROWS(open(), InputError, "expected a frame number, got \"format\", in ",
                "v/clip.json (taken as the labels of v/clip.avi)");
}

TEST_F(VideoDatasetTest, RefusesWhatIsNoVideo) {
  write("v/clip.avi", "no video at all");
  EXPECT_THROWS(open(), InputError, "v/clip.avi");
}

class VideoFolderTest : public VideoDatasetTest {
 protected:
  VideoFolderTest() { spec_.root = "v"; }
};

TEST_F(VideoFolderTest, EachVideoIsASequence) {
  testing::write_counting_video(at("v/b.AVI"), 3);
  write("v/b.json", R"({"1": "one"})");
  write("v/clip.json", R"({"1": "another"})");
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u + 7u);
  EXPECT_EQ(text_of(frames[1]), "b/000001 of b: v/b.AVI 1 by b/1");
  EXPECT_EQ(text_of(frames[4]), "clip/000001 of clip: v/clip.avi 1 by clip/1");
  // The end of one video is not the beginning of the next.
  EXPECT_THAT(paired(*dataset, 2, {1}), ElementsAre("beyond"));
  EXPECT_THAT(paired(*dataset, 3, {-1, 6}), ElementsAre("beyond", "present v/clip.avi 6"));
  EXPECT_DOUBLE_EQ(frames[4].frame.time_s, 1.0 / 20);  // each at its own rate
  EXPECT_DOUBLE_EQ(frames[1].frame.time_s, 1.0 / 25);
  EXPECT_EQ(annotation_of(*dataset, 1).original, "\"one\"");
  EXPECT_EQ(annotation_of(*dataset, 4).original, "\"another\"");
  EXPECT_EQ(annotation_of(*dataset, 0).original, "");
  EXPECT_EQ(dataset->label_place(frames[4].label_key), "v/clip.json#1");
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("v/b.json", "v/clip.json"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(VideoFolderTest, NotesWhatItLeavesOut) {
  touch({"v/.hidden.avi", "v/clip.mkv", "v/other.json", "v/readme.txt"});
  fs::create_directory(at("v/more"));
  EXPECT_THAT(open()->notes(), ElementsAre("4 entries left out in v: clip.mkv, more, "
                                           "other.json, readme.txt"));
}

TEST_F(VideoFolderTest, AVideoThatCannotBeReadIsLeftOutWithItsReason) {
  write("v/a.mp4", "no video");
  EXPECT_EQ(open()->labelled_frames().size(), 7u);
  EXPECT_THAT(open()->notes(),
              ElementsAre(AllOf(HasSubstr("1 video left out: "),
                                HasSubstr("expected a video, got a file that cannot "
                                          "be read as one"),
                                HasSubstr("v/a.mp4"))));
  fs::remove(at("v/clip.avi"));
  EXPECT_THROWS(open(), InputError, "v/a.mp4");
}

TEST_F(VideoFolderTest, ImagesCountBeforeVideosAndVideosBeforeFolders) {
  write("v/images/1.png");
  EXPECT_EQ(open()->labelled_frames().front().sample_id, "clip/000000");
  write("v/1.png");
  EXPECT_EQ(open()->labelled_frames().front().sample_id, "1");
  EXPECT_THAT(open()->notes(), Contains(HasSubstr("clip.avi")));
}

TEST(IsVideoName, GoesByTheExtension) {
  for (const char* name : {"a.mp4", "a.b.AVI", "x/a.mov", "a.Mkv", "a.webm", "a.TS", "a.gif"})
    EXPECT_TRUE(is_video_name(name)) << name;
  for (const char* name : {"a.png", "mp4", "a.mp4.txt", ""}) EXPECT_FALSE(is_video_name(name));
}

TEST(VideoDatasetOnSharedData, CountsTheFramesOfAClip) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.root = "clips/01_dog.mp4";
  const auto dataset = open_frames_dataset(spec, data);
  ASSERT_EQ(dataset->labelled_frames().size(), 289u);
  EXPECT_EQ(dataset->labelled_frames().back().sample_id, "01_dog/000288");
  EXPECT_NEAR(dataset->labelled_frames()[30].frame.time_s, 30 * 1001.0 / 30000, 1e-9);  // 29.97 Hz
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

}  // namespace
}  // namespace eventgan

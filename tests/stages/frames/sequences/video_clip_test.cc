#include "stages/frames/sequences/video_clip.h"

#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/packet.h>
#include <libavformat/avformat.h>
}

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "manifests/faults.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(VideoClip, CountsToTheEndOrAsFarAsIsEnough) {
  const testing::TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 12);
  const VideoClip whole = measure_video(folder / "clip.avi");
  EXPECT_EQ(whole.frame_count, 12);
  EXPECT_EQ(whole.frames_per_second, 25);
  const VideoClip part = measure_video(folder / "clip.avi", 5);
  EXPECT_EQ(part.frame_count, 5);
  EXPECT_EQ(part.frames_per_second, 25);
  EXPECT_EQ(part.announced_count, whole.announced_count);
  EXPECT_EQ(measure_video(folder / "clip.avi", 13).frame_count, 12);
}

TEST(VideoClip, KeepsTheTimesOfFramesThatComeUnevenly) {
  const testing::TemporaryFolder folder;
  testing::write_timed_video(folder / "clip.mkv", {40, 140, 640, 740, 1240, 1340});
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_EQ(clip.frame_count, 6);
  const double expected[] = {0, 0.1, 0.6, 0.7, 1.2, 1.3};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(clip.time_s(i), expected[i], 1e-9);
  EXPECT_NEAR(measure_video(folder / "clip.mkv", 3).time_s(2), 0.6, 1e-9);
}

TEST(VideoClip, TimesRoundedToMillisecondsAreThoseOfTheRate) {
  const testing::TemporaryFolder folder;
  std::vector<int> thirds;  // 30 Hz, as Matroska has it
  for (int i = 0; i < 31; ++i) thirds.push_back((i * 1000 + 15) / 30);
  testing::write_timed_video(folder / "clip.mkv", thirds);
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_DOUBLE_EQ(clip.time_s(10), 10 / *clip.frames_per_second);
  EXPECT_NEAR(clip.time_s(30), 1, 2e-3);
}

TEST(VideoClip, TimesThatDoNotAscendAreNotTaken) {
  const testing::TemporaryFolder folder;
  testing::write_timed_video(folder / "clip.mkv", {0, 100, 100, 100, 500});
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_FALSE(clip.times_ascend);
}

/// Copies a video's packets to a Matroska file in which its i-th frame is shown at times_ms[i].
void copy_retimed(const std::filesystem::path& from, const std::filesystem::path& to,
                  const std::vector<int>& times_ms) {
  AVFormatContext* in = nullptr;
  AVFormatContext* out = nullptr;
  ASSERT_EQ(avformat_open_input(&in, from.c_str(), nullptr, nullptr), 0);
  ASSERT_GE(avformat_alloc_output_context2(&out, nullptr, "matroska", to.c_str()), 0);
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
  std::int64_t decoded_ms = -1000;  // each before it is shown
  for (AVPacket* packet : packets) {
    const auto shown_as = std::ranges::lower_bound(order, packet->pts) - order.begin();
    packet->pts = times_ms[static_cast<std::size_t>(shown_as)];
    packet->dts = decoded_ms++;
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
TEST(VideoClip, FramesStoredInAnotherOrderHaveTheirOwnTimes) {
  const testing::TemporaryFolder folder;
  constexpr int kFrames = 30;
  {
    cv::VideoWriter writer((folder / "even.mp4").string(), cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc('a', 'v', 'c', '1'), 25, cv::Size(64, 48));
    if (!writer.isOpened()) GTEST_SKIP() << "skipped: no H.264 encoder";
    for (int i = 0; i < kFrames; ++i)
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(2 * i)));
  }
  const VideoClip even = measure_video(folder / "even.mp4");
  EXPECT_EQ(even.frame_count, kFrames);
  EXPECT_TRUE(even.times_ascend);
  EXPECT_TRUE(even.uneven_times_s.empty());

  std::vector<int> times_ms;  // steps of 20, 40 and 100 ms by turns
  for (int i = 0; i < kFrames; ++i) {
    const int steps_ms[] = {0, 20, 60};
    times_ms.push_back(i / 3 * 160 + steps_ms[i % 3]);
  }
  copy_retimed(folder / "even.mp4", folder / "uneven.mkv", times_ms);
  const VideoClip uneven = measure_video(folder / "uneven.mkv");
  ASSERT_EQ(uneven.frame_count, kFrames);
  ASSERT_EQ(uneven.uneven_times_s.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) EXPECT_NEAR(uneven.time_s(i), times_ms[i] / 1000.0, 1e-9) << i;
}

TEST(VideoClip, RefusesWhatIsNoVideo) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(measure_video(folder / "none.avi"), InputError);
  testing::write_file(folder / "words.avi", "words");
  EXPECT_THROW(measure_video(folder / "words.avi", 1), InputError);
}

}  // namespace
}  // namespace eventgan

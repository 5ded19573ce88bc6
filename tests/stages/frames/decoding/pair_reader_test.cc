#include "stages/frames/decoding/pair_reader.h"

#include <hdf5.h>

#include "tests/stages/base/images/test_images.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

using ::testing::FloatEq;

/// Grey level back from the network's input.
int level(float x) { return static_cast<int>(std::lround((x / 2 + 0.5f) * 255)); }

std::vector<int> levels(const PreparedPair& pair) {
  std::vector<int> result;
  for (const float x : pair.input) result.push_back(level(x));
  return result;
}

FramePair pair_of(const std::string& previous, const std::string& next) {
  FramePair pair;
  pair.previous.path = previous;
  pair.next.path = next;
  return pair;
}

PreparedPair read(const TemporaryFolder& folder, const cv::Mat& image, const ImageSpec& spec) {
  cv::imwrite((folder / "a.png").string(), image);
  auto outcome = PairReader(folder.path(), spec).read(pair_of("a.png", "a.png"));
  if (is_fault(outcome)) throw std::runtime_error(outcome.fault().reason);
  return *outcome;
}

TEST(PairReader, GreyIsWeightedAndScaledToMinusOneToOne) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), cv::Mat(1, 1, CV_8UC3, cv::Scalar(10, 200, 30)));
  cv::imwrite((folder / "b.png").string(), cv::Mat(1, 1, CV_8UC3, cv::Scalar(255, 255, 255)));
  const auto outcome = PairReader(folder.path(), {}).read(pair_of("a.png", "b.png"));
  // 0.114 * 10 + 0.587 * 200 + 0.299 * 30 = 127.51, so 128; the previous frame comes first.
  EXPECT_THAT(outcome->input, ElementsAre(FloatEq((128.0f / 255.0f - 0.5f) * 2.0f), FloatEq(1.0f)));
}

TEST(PairReader, WithoutASizeTheImageKeepsItsOwn) {
  const TemporaryFolder folder;
  const PreparedPair pair = read(folder, testing::gradient_image({5, 7}), {});
  EXPECT_EQ(pair.content, (ImageSize{5, 7}));
  EXPECT_EQ(pair.placement.volume, (ImageSize{5, 7}));
  EXPECT_EQ(pair.input.size(), 2u * 5 * 7);
}

TEST(PairReader, StretchesBilinearly) {
  const TemporaryFolder folder;
  const cv::Mat image = (cv::Mat_<std::uint8_t>(2, 4) << 0, 100, 20, 40,  //
                         50, 150, 60, 80);
  ImageSpec spec;
  spec.size = ImageSize{1, 2};
  // Halved in both directions, a pixel's centre falls between four: their means are 75 and 50.
  const PreparedPair pair = read(folder, image, spec);
  EXPECT_THAT(levels(pair), ElementsAre(75, 50, 75, 50));
  EXPECT_EQ(pair.content, (ImageSize{1, 2}));
}

TEST(PairReader, GreyBeforeAndAfterResizingRoundDifferently) {
  const TemporaryFolder folder;
  // Blue 0, 4, 4, 4. Grey first: 0.114 * 4 = 0.456 rounds to 0 everywhere. Grey last: the mean of
  // blue is 3, 0.342 is 0 as well; so red 0, 1, 1, 1 joins: 0.456 + 0.299 = 0.755 rounds to 1, the
  // mean of 0, 1, 1, 1 to 1. Red's mean is 1 too: 0.342 + 0.299 = 0.641 rounds to 1. With red 0, 2,
  // 0, 0: grey first is 0, 1.054 -> 1, 0, 0 with mean 0.25 -> 0; grey last, blue 3 and red 1: 0.641
  // -> 1.
  cv::Mat image(2, 2, CV_8UC3);
  image.at<cv::Vec3b>(0, 0) = {0, 0, 0};
  image.at<cv::Vec3b>(0, 1) = {4, 0, 2};
  image.at<cv::Vec3b>(1, 0) = {4, 0, 0};
  image.at<cv::Vec3b>(1, 1) = {4, 0, 0};
  ImageSpec spec;
  spec.size = ImageSize{1, 1};
  spec.grey = GreyOrder::kBeforeResize;
  EXPECT_THAT(levels(read(folder, image, spec)), ElementsAre(0, 0));
  spec.grey = GreyOrder::kAfterResize;
  EXPECT_THAT(levels(read(folder, image, spec)), ElementsAre(1, 1));
}

TEST(PairReader, BlursTheResizedImageBeforeItIsCut) {
  const TemporaryFolder folder;
  // One row of four, resized to itself, cropped to the middle two. The 3x1 kernel is 1/4 1/2 1/4
  // and takes in 200 and 40 from outside the crop: (200 + 0 + 100)/4 = 75, (0 + 200 + 40)/4 = 60.
  const cv::Mat image = (cv::Mat_<std::uint8_t>(1, 4) << 200, 0, 100, 40);
  ImageSpec spec;
  spec.size = ImageSize{1, 2};
  spec.fit = ImageFit::kCrop;
  spec.blur = 3;
  const PreparedPair pair = read(folder, image, spec);
  EXPECT_THAT(levels(pair), ElementsAre(75, 60, 75, 60));
  EXPECT_EQ(pair.content_x, 0);
  EXPECT_EQ(pair.content, (ImageSize{1, 2}));
}

TEST(PairReader, LetterboxLeavesTheBordersOut) {
  const TemporaryFolder folder;
  ImageSpec spec;
  spec.size = ImageSize{10, 8};
  spec.fit = ImageFit::kLetterbox;
  // 16x8 into 8x10: halved to 8x4, three rows of border above and below.
  const PreparedPair pair = read(folder, cv::Mat(8, 16, CV_8UC1, cv::Scalar(255)), spec);
  EXPECT_EQ(pair.content, (ImageSize{4, 8}));
  EXPECT_EQ(pair.content_x, 0);
  EXPECT_EQ(pair.content_y, 3);
  EXPECT_EQ(pair.input, std::vector<float>(2 * 4 * 8, 1.0f));
}

TEST(PairReader, FramesOfDifferentSizesAreAFault) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), testing::gradient_image({5, 7}));
  cv::imwrite((folder / "b.png").string(), testing::gradient_image({5, 8}));
  const auto outcome = PairReader(folder.path(), {}).read(pair_of("a.png", "b.png"));
  EXPECT_EQ(outcome.fault().reason,
            "expected two frames of one size, got 7x5 in a.png and 8x5, in b.png");
}

TEST(PairReader, ABadFrameOfEitherSideIsAFault) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), testing::gradient_image({5, 7}));
  const PairReader reader(folder.path(), {});
  for (const auto& pair : {pair_of("none.png", "a.png"), pair_of("a.png", "none.png")}) {
    EXPECT_THAT(fault_of(reader.read(pair)), HasSubstr("in none.png"));
  }
}

FramePair clip_pair(int previous, int next, int gap_frames = 0) {
  FramePair pair;
  pair.previous = testing::video_ref("clip.avi", previous);
  pair.next = testing::video_ref("clip.avi", next);
  pair.gap_frames = gap_frames;
  return pair;
}

/// Frame i of the video is grey of value 2 i.
void expect_frames(const PairReader& reader, const FramePair& pair) {
  const auto outcome = reader.read(pair);
  ASSERT_EQ(fault_of(outcome), "no fault") << pair.next.video_frame;
  const auto& input = outcome->input;
  EXPECT_NEAR(level(input[input.size() / 4]), 2 * pair.previous.video_frame, 1);
  EXPECT_NEAR(level(input[input.size() / 4 * 3]), 2 * pair.next.video_frame, 1);
}

TEST(PairReader, ReadsPairsFromAVideo) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 20);
  expect_frames(PairReader(folder.path(), {}), clip_pair(10, 16));
}

TEST(PairReader, PairsUnderWayMayComeInAnyOrderAndTheVideoIsOpenedOnce) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 127);
  // The worst order of 60 pairs at once, each reaching 6 frames back: the last of them first. Then
  // frames 6 - 6 = 0 to 6 + 59 = 65 are wanted in turn, and 60 to 125 after them.
  constexpr int kUnderWay = 60;
  const PairReader reader(folder.path(), {}, kUnderWay);
  for (const int first : {6, 6 + kUnderWay}) {
    for (int next = first + kUnderWay - 1; next >= first; --next) {
      expect_frames(reader, clip_pair(next - 6, next));
      // The open video outlives its name; opening it a second time fails.
      fs::remove(folder / "clip.avi");
    }
  }
}

TEST(PairReader, OfAThinnedVideoTheFramesTakenAreKept) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 127);
  // One frame in five: pairs that reach 6 steps, 30 frames, back, the later of two first. A window
  // of 2 + 6 + 2 frames in a row would have opened the video again.
  const PairReader reader(folder.path(), {}, /*pairs_under_way=*/2);
  for (int first = 30; first + 5 < 127; first += 10) {
    for (const int next : {first + 5, first}) {
      expect_frames(reader, clip_pair(next - 30, next, 6));
      // The open video outlives its name; opening it a second time fails.
      fs::remove(folder / "clip.avi");
    }
  }
}

TEST(PairReader, OneVideoIsReadWholeAndThinnedByTurns) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 60);
  const PairReader reader(folder.path(), {});
  for (int next = 12; next < 60; next += 12) {
    for (const int stride : {1, 4, 6}) expect_frames(reader, clip_pair(next - 2 * stride, next, 2));
  }
}

TEST(PairReader, FramesOfAVideoAndOfAFolderPair) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 20);
  cv::imwrite((folder / "a.png").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(77)));
  const PairReader reader(folder.path(), {});
  FramePair pair = pair_of("a.png", "");
  pair.next = testing::video_ref("clip.avi", 9);
  const std::vector<float> input = reader.read(pair)->input;
  EXPECT_EQ(level(input.front()), 77);
  EXPECT_NEAR(level(input.back()), 18, 1);
  std::swap(pair.previous, pair.next);
  EXPECT_EQ(level(reader.read(pair)->input.back()), 77);
  pair.previous.video_frame = 20;
  EXPECT_EQ(fault_of(reader.read(pair)),
            "expected a frame at position 20, got a video whose frames end after 20, in clip.avi");
  pair.next = testing::video_ref("clip.avi", 9);
  EXPECT_EQ(fault_of(reader.read(pair)),
            "expected a frame at position 20, got a video whose frames end after 20, in clip.avi");
}

TEST(PairReader, AStillIsDecodedOnceForAllOfItsClip) {
  const TemporaryFolder folder;
  for (const auto& [name, grey] : {std::pair{"a.png", 77}, {"b.png", 99}}) {
    cv::imwrite((folder / name).string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(grey)));
  }
  for (const bool tells_between : {false, true}) {
    SCOPED_TRACE(tells_between);
    const PairReader reader(folder.path(), {}, 16, tells_between);
    const auto clip = [&](const std::string& name) {
      FramePair pair = pair_of(name, name);
      pair.poses = {StillPose(), {{.x_px = 1.5}}};
      reader.expect(pair);
      return reader.read(pair);
    };
    const auto first = clip("a.png");
    fs::rename(folder / "a.png", folder / "away.png");
    const auto second = clip("a.png");
    ASSERT_FALSE(is_fault(second)) << second.fault().reason;
    EXPECT_EQ(second->input, first->input);
    EXPECT_EQ(level(second->input.front()), 77);
    EXPECT_EQ(level(clip("b.png")->input.front()), 99);
    EXPECT_TRUE(is_fault(clip("a.png"))) << "the last one alone is kept";
    fs::rename(folder / "away.png", folder / "a.png");
  }
}

template <class T>
std::vector<T> read_dataset(hid_t file, const std::string& name, hid_t type, std::size_t count) {
  std::vector<T> values(count);
  const hid_t dataset = H5Dopen2(file, name.c_str(), H5P_DEFAULT);
  if (H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) values.clear();
  H5Dclose(dataset);
  return values;
}

TEST(PairReader, InputEqualsTheReferenceBitForBit) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const hid_t file = H5Fopen((data / "golden/golden.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const ImageSize size{75, 53};
  const std::size_t plane = size.pixel_count();
  const std::string group = "generator/53x75_odd/";
  auto frames = read_dataset<std::uint8_t>(file, group + "frames_u8", H5T_NATIVE_UINT8, 2 * plane);
  const auto expected = read_dataset<float>(file, group + "input", H5T_NATIVE_FLOAT, 2 * plane);
  H5Fclose(file);
  ASSERT_EQ(frames.size(), 2 * plane);

  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(),
              cv::Mat(size.height, size.width, CV_8UC1, frames.data()));
  cv::imwrite((folder / "b.png").string(),
              cv::Mat(size.height, size.width, CV_8UC1, frames.data() + plane));
  const auto outcome = PairReader(folder.path(), {}).read(pair_of("a.png", "b.png"));
  EXPECT_EQ(outcome->input, expected);
}

}  // namespace
}  // namespace eventgan

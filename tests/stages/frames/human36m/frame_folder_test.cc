#include <gtest/gtest.h>

#include "stages/frames/human36m/frame_folder_internal.h"

namespace eventgan {
namespace {

using State = Neighbour::State;

NumberedSequence stored(const std::vector<std::int64_t>& numbers) {
  std::vector<NumberedSequence::Frame> frames;
  for (const std::int64_t number : numbers) {
    frames.emplace_back(number, "img_00" + std::to_string(number) + ".png");
  }
  return NumberedSequence(std::move(frames));
}

TEST(FrameFolderTest, CountsStoredFramesWhateverTheirNumbers) {
  // Labels lie farther apart than pictures.
  const FrameFolder folder("root/7", "img_", stored({1000, 1005, 1006, 1040}), {1000, 1040});
  const Neighbour next = folder.neighbour(1000, 1);
  EXPECT_EQ(next.state, State::kPresent);
  EXPECT_EQ(next.frame.path, "root/7/img_001005.png");
  EXPECT_EQ(folder.neighbour(1000, 2).frame.index, 1006);
  EXPECT_EQ(folder.neighbour(1000, 3).frame.index, 1040);
  EXPECT_EQ(folder.neighbour(1000, 4).state, State::kBeyond);
  EXPECT_EQ(folder.neighbour(1040, -3).frame.index, 1000);
  EXPECT_EQ(folder.neighbour(1040, -4).state, State::kBeyond);
}

TEST(FrameFolderTest, ALabelledFrameWithoutPictureCountsAsAHole) {
  const FrameFolder folder("root/7", "img_", stored({1000, 1005}), {1010, 1000, 1003, 1003});
  const Neighbour hole = folder.neighbour(1000, 1);
  EXPECT_EQ(hole.state, State::kHole);
  EXPECT_EQ(hole.frame.path, "root/7/img_001003.png");
  EXPECT_EQ(folder.neighbour(1000, 2).frame.index, 1005);
  EXPECT_EQ(folder.neighbour(1003, 0).state, State::kHole);
  EXPECT_EQ(folder.neighbour(1005, 1).state, State::kHole);
  EXPECT_EQ(folder.neighbour(1005, 2).state, State::kBeyond);
}

TEST(FrameFolderTest, AFrameThatIsNotThereHasThoseBesideIt) {
  const FrameFolder folder("root/7", "img_", stored({1000, 1005}), {});
  EXPECT_EQ(folder.neighbour(1002, 0).state, State::kHole);
  EXPECT_EQ(folder.neighbour(1002, 1).frame.index, 1005);
  EXPECT_EQ(folder.neighbour(1002, -1).frame.index, 1000);
  EXPECT_EQ(folder.neighbour(1002, 2).state, State::kBeyond);
}

TEST(FrameFolderTest, NamesAbsentFramesLikeTheStoredOnes) {
  EXPECT_EQ(FrameFolder("r", "img_", stored({1000}), {}).frame(1001).path, "r/img_001001.png");
  EXPECT_EQ(FrameFolder("r", "img_", {}, {}).frame(12).path, "r/img_000012.jpg");
  EXPECT_EQ(FrameFolder("r", "img_", {}, {}).frame(1234567).path, "r/img_1234567.jpg");
}

TEST(FrameFolderTest, EmptyFolderHasNoNeighbours) {
  const FrameFolder folder("r", "img_", {}, {});
  EXPECT_EQ(folder.neighbour(1, 1).state, State::kBeyond);
  EXPECT_EQ(folder.neighbour(1, 0).state, State::kHole);
}

}  // namespace
}  // namespace eventgan

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
  return NumberedSequence(std::move(frames), NumberedSequence::Stride::kInferred);
}

TEST(FrameFolderTest, StrideComesFromTheStoredFrames) {
  // Labels lie farther apart than pictures.
  const FrameFolder folder("root/7", "img_", stored({1000, 1005, 1010, 1015}), {1000, 1015});
  const Neighbour next = folder.neighbour(1000, 1);
  EXPECT_EQ(next.state, State::kPresent);
  EXPECT_EQ(next.frame.path, "root/7/img_001005.png");
  EXPECT_EQ(folder.neighbour(1000, 3).frame.index, 1015);
  EXPECT_EQ(folder.neighbour(1000, 4).state, State::kBeyond);
}

TEST(FrameFolderTest, StrideComesFromTheLabelsWhereNothingIsStored) {
  for (const auto& numbers : {std::vector<std::int64_t>{}, std::vector<std::int64_t>{1000}}) {
    const FrameFolder folder("root/7", "img_", stored(numbers), {1010, 1000, 1005, 1005});
    const Neighbour next = folder.neighbour(1005, 1);
    EXPECT_EQ(next.state, State::kHole);
    EXPECT_EQ(next.frame.index, 1010);
    EXPECT_EQ(folder.neighbour(1005, 2).state, State::kBeyond);
  }
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

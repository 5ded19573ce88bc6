#include "stages/events/pictures/comparison_picture.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

/// Grey frames, no generated event, and a real one in the last bin at row 1, column 2.
ComparedPair pair_of(ImageSize size) {
  ComparedPair pair;
  pair.shape = {2, size};
  pair.frames.assign(2 * size.pixel_count(), 0.0f);
  pair.generated.assign(pair.shape.value_count(), 0.0f);
  pair.real = pair.generated;
  pair.real[size.pixel_count() + static_cast<std::size_t>(size.width) + 2] = 5.0f;
  pair.title = "a pair";
  return pair;
}

TEST(WriteComparisonPng, ShowsFramesAndBothVolumes) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "pairs.png";
  write_comparison_png(std::vector{pair_of({8, 160}), pair_of({8, 160})}, file);
  const cv::Mat picture = cv::imread(file.string());
  // Panels of 160x8 enlarged twice, 6 pixels between them, 22 above and below each row.
  EXPECT_EQ(picture.size(), cv::Size(4 * 326 + 6, 2 * (16 + 44)));
  const auto middle = [&](int panel) {
    return picture.at<cv::Vec3b>(22 + 3, 6 + panel * 326 + 5);  // row 1, column 2, enlarged
  };
  EXPECT_EQ(middle(0), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(middle(1), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(middle(2), cv::Vec3b(0, 0, 0));
  EXPECT_GT(middle(3)[2], 200);  // late: red
}

TEST(WriteComparisonPng, TakesPairsOfSeveralSizes) {
  const testing::TemporaryFolder folder;
  write_comparison_png(std::vector{pair_of({3, 400}), pair_of({3, 3})}, folder / "pairs.png");
  EXPECT_EQ(cv::imread((folder / "pairs.png").string()).cols, 4 * 406 + 6);
}

TEST(WriteComparisonPng, RefusesWhatDoesNotFit) {
  ComparedPair pair = pair_of({4, 4});
  pair.real.pop_back();
  EXPECT_THROW(write_comparison_png(std::vector{pair}, "/tmp/never.png"), std::invalid_argument);
  EXPECT_THROW(write_comparison_png({}, "/tmp/never.png"), std::invalid_argument);
  EXPECT_THROW(write_comparison_png(std::vector{pair_of({4, 4})}, "/nowhere/pairs.png"),
               std::runtime_error);
}

}  // namespace
}  // namespace eventgan

#include "pipeline/training/records/loss_curves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

LossRow row_of(std::int64_t step, std::size_t loss, double value) {
  LossRow row;
  row.position = {TrainingPhase::kGenerator, step};
  row.losses.fill(std::numeric_limits<double>::quiet_NaN());
  row.losses[loss] = value;
  return row;
}

cv::Mat drawn(const std::vector<LossRow>& rows) {
  const testing::TemporaryFolder folder;
  write_loss_curves(rows, folder / "curves.png");
  return cv::imread((folder / "curves.png").string());
}

int coloured_pixels(const cv::Mat& picture) {
  int count = 0;
  for (int i = 0; i < static_cast<int>(picture.total()); ++i) {
    const auto& pixel = picture.at<cv::Vec3b>(i);
    count += pixel[0] != pixel[1];
  }
  return count;
}

TEST(WriteLossCurves, HasAPanelForEachLossThatIsThere) {
  std::vector<LossRow> rows;
  for (int i = 0; i < 50; ++i) {
    rows.push_back(row_of(i, static_cast<std::size_t>(i % 3), std::exp(-i / 5.0)));
  }
  const cv::Mat picture = drawn(rows);
  EXPECT_EQ(picture.size(), cv::Size(1040, 480));  // three panels in two lines
  EXPECT_GT(coloured_pixels(picture), 500);
}

TEST(WriteLossCurves, DrawsExtremes) {
  EXPECT_EQ(coloured_pixels(drawn({})), 0);
  EXPECT_GT(coloured_pixels(drawn({row_of(0, 0, 1)})), 0);  // one value
  EXPECT_GT(coloured_pixels(drawn({row_of(0, 0, 0), row_of(1, 0, 0)})), 0);
  EXPECT_GT(coloured_pixels(drawn({row_of(0, 0, -1e30), row_of(1, 0, 1e30)})), 0);
  EXPECT_GT(coloured_pixels(drawn({row_of(0, 0, 1e-30), row_of(1, 0, 1e30)})), 0);
}

TEST(WriteLossCurves, NamesTheFileItCannotWrite) {
  EXPECT_THROW(write_loss_curves({}, "/nowhere/curves.png"), std::runtime_error);
}

}  // namespace
}  // namespace eventgan

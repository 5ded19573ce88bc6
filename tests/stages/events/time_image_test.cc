#include "stages/events/time_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

TEST(TimeImage, IsTheMeanTimeWeightedByTheVolume) {
  // 3 bins at 0.1, 0.55, 1; one pixel with 1 in the first and 3 in the last: (0.1 + 3) / 4 = 0.775.
  const std::vector<float> volume{1, 0, 3, 0, 2, 0};
  const TimeImage image = time_image(volume, {3, {1, 1}});
  EXPECT_NEAR(image.positive[0], 0.775f, 1e-5f);
  EXPECT_NEAR(image.negative[0], 0.55f, 1e-5f);
}

TEST(TimeImage, WithoutEventsIsZero) {
  const std::vector<float> volume(2 * 9 * 6, 0.0f);
  const TimeImage image = time_image(volume, {9, {2, 3}});
  EXPECT_EQ(image.positive.size(), 6u);
  EXPECT_THAT(image.positive, ::testing::Each(0.0f));
  EXPECT_THAT(image.negative, ::testing::Each(0.0f));
}

TEST(TimeImage, OfOneBinIsTheFirstTime) {
  const std::vector<float> volume{5, 0};
  EXPECT_NEAR(time_image(volume, {1, {1, 1}}).positive[0], 0.1f, 1e-6f);
}

TEST(TimeImage, EqualsThePublishedCode) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const auto volumes = testing::read_array(golden, "time_image/volume");
  const auto expected = testing::read_array(golden, "time_image/image");
  const VolumeShape shape{9, {int(volumes.shape[2]), int(volumes.shape[3])}};
  for (std::size_t sample = 0; sample < volumes.shape[0]; ++sample) {
    const std::span volume(volumes.values.data() + sample * shape.value_count(),
                           shape.value_count());
    const TimeImage image = time_image(volume, shape);
    for (std::size_t i = 0; i < shape.size.pixel_count(); ++i) {
      const float published = (image.positive[i] + image.negative[i]) / 2;
      ASSERT_NEAR(published, expected.values[sample * shape.size.pixel_count() + i], 1e-6f) << i;
    }
  }
}

}  // namespace
}  // namespace eventgan

#include "stages/events/event_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::Optional;

// Two bins of 2 x 3 pixels: channel c has the value c + 1 in pixel c, and pixel 5 has 0.1 in all.
const VolumeShape kPlacesShape{2, {2, 3}};

std::vector<float> volume() {
  std::vector<float> values(kPlacesShape.value_count(), 0.0f);
  for (std::size_t channel = 0; channel < 4; ++channel) {
    values[channel * 6 + channel] = static_cast<float>(channel + 1);
    values[channel * 6 + 5] = 0.125f;
  }
  return values;
}

TEST(EventPlaces, AreSumsOfChannelsAndTheMaskHasPixelsThatSumToEnough) {
  EXPECT_THAT(channel_sums(volume(), kPlacesShape), ElementsAre(1.125, 2.125, 3.125, 4.125));
  EXPECT_THAT(event_mask(volume(), kPlacesShape, 0.5), ElementsAre(1, 1, 1, 1, 0, 1));
  EXPECT_THAT(event_mask(volume(), kPlacesShape, 1.5), ElementsAre(0, 1, 1, 1, 0, 0));
}

TEST(EventPlaces, APixelBelongsToTheBoxItsCentreLiesIn) {
  const std::vector<std::uint8_t> mask{1, 0, 0, 0, 0, 1};
  const ImageSize size{2, 3};
  EXPECT_THAT(share_inside(mask, size, {0, 0, 3, 2}), Optional(2.0 / 6));
  EXPECT_THAT(share_inside(mask, size, {0.4, 0, 1.6, 1}), Optional(0.5));  // pixels 0 and 1
  EXPECT_THAT(share_inside(mask, size, {0.6, 0, 1.4, 1}), std::nullopt) << "no centre";
  EXPECT_THAT(share_inside(mask, size, {2, 1, 100, 100}), Optional(1.0));
  EXPECT_THAT(share_inside(mask, size, {-5, -5, -1, -1}), std::nullopt);
  EXPECT_THAT(share_inside(mask, size, {3, 2, 1, 1}), std::nullopt);
}

TEST(EventPlaces, NearIsASquareAroundThePixel) {
  const std::vector<std::uint8_t> mask{0, 0, 0, 0, 0, 1};
  const ImageSize size{2, 3};
  EXPECT_THAT(is_set_near(mask, size, {2.4, 0.6}, 0), Optional(true));
  EXPECT_THAT(is_set_near(mask, size, {1, 0}, 0), Optional(false));
  EXPECT_THAT(is_set_near(mask, size, {1, 0}, 1), Optional(true));
  EXPECT_THAT(is_set_near(mask, size, {0, 0}, 1), Optional(false));
  EXPECT_THAT(is_set_near(mask, size, {-1, -1}, 5), std::nullopt);
  EXPECT_THAT(is_set_near(mask, size, {3, 0}, 5), std::nullopt);
}

}  // namespace
}  // namespace eventgan

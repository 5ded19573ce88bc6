#include "stages/events/normalization.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "stages/events/volume_statistics.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

TEST(Normalize, ClipsAndDividesAndLeavesAnEmptyVolumeAlone) {
  std::vector<float> volume{0, 1, 2, 8};
  normalize(volume, 4.0f);
  EXPECT_THAT(volume, ::testing::ElementsAre(0, 0.25f, 0.5f, 1));
  std::vector<float> empty(5, 0.0f);
  normalize(empty, 0.0f);
  EXPECT_THAT(empty, ::testing::Each(0.0f));
}

TEST(Normalize, OfTheSmallestNumbersIsFinite) {
  std::vector<float> volume(4, std::numeric_limits<float>::denorm_min());
  normalize(volume, eta98(volume));
  EXPECT_THAT(volume, ::testing::Each(1.0f));
}

TEST(Normalize, EqualsThePublishedCode) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  for (const std::string& name : testing::member_names(golden, "events")) {
    auto volume = testing::read_array(golden, "events/" + name + "/volume").values;
    const auto expected = testing::read_array(golden, "events/" + name + "/normalized").values;
    normalize(volume, eta98(volume));
    EXPECT_THAT(volume, ::testing::Pointwise(::testing::FloatNear(1e-6f), expected)) << name;
  }
}

TEST(Normalized, DividesByTheVolumesOwnEta98) {
  // Two values that are not zero: k = max(int(1.96), 1) = 1, the lower one.
  EXPECT_EQ(normalized({0, 2, 8, 0}), (std::vector<float>{0, 1, 1, 0}));
  EXPECT_EQ(normalized({0, 0}), (std::vector<float>{0, 0}));
}

}  // namespace
}  // namespace eventgan

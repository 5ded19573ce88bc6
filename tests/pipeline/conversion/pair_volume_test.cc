#include "pipeline/conversion/pair_volume.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/testing/fake_generator.h"

namespace eventgan {
namespace {

TEST(GenerateVolume, OfAStillThatRestsAsksNoGenerator) {
  const testing::FakeGenerator generator;
  GeneratorSpec esim;
  esim.kind = GeneratorKind::kEsim;
  PreparedPair pair;
  pair.content = {4, 6};
  pair.input.assign(2 * 24, 0.5f);
  pair.between.at = [](double) { return GreyImage{{4, 6}, std::vector<std::uint8_t>(24)}; };
  std::vector<float> volume(18 * 24, 1.0f);
  for (const double moved_px : {0.0, 0.1}) {  // of stripes the ends may be one image all the same
    pair.between.displacement_px = moved_px;
    const int before = generator.calls();
    const auto part = generate_volume(generator, esim, {}, pair, {}, volume);
    EXPECT_EQ(part.same_image, moved_px == 0);
    EXPECT_EQ(generator.calls() - before, moved_px != 0);
    EXPECT_THAT(volume, ::testing::Each(0));
  }
}

}  // namespace
}  // namespace eventgan

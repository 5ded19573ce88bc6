#include "manifests/values/counter_random.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

namespace eventgan {
namespace {

TEST(CounterRandom, WithSeed0IsSplitMix64AndNeverChanges) {
  // The first outputs of the reference implementation (Vigna, splitmix64.c) from state 0; the key
  // of seed 0 is 0, since the finaliser maps 0 to 0.
  const CounterRandom random(0);
  EXPECT_EQ(random.bits(0), 0xe220a8397b1dcdafu);
  EXPECT_EQ(random.bits(1), 0x6e789e6aa1b965f4u);
  EXPECT_EQ(random.bits(2), 0x06c45d188009454fu);
  // Computed apart in Python from the definition in the header. Plans depend on these numbers.
  EXPECT_EQ(CounterRandom(7).bits(0), 0x863b891f4c0abd4fu);
  EXPECT_EQ(CounterRandom(7).bits(1), 0x4d58fbd282eaf415u);
  EXPECT_EQ(CounterRandom(7).keyed("kitti").bits(0), 0xf2e390df7a752b8bu);
}

TEST(CounterRandom, SeedsWordsAndTheirOrderAllCount) {
  const CounterRandom a(1), b(2);
  const std::set<std::uint64_t> drawn{a.bits(0),
                                      b.bits(0),
                                      a.bits(1),
                                      a.keyed("").bits(0),
                                      a.keyed("x").bits(0),
                                      a.keyed("y").bits(0),
                                      b.keyed("x").bits(0),
                                      a.keyed("x").keyed("y").bits(0),
                                      a.keyed("y").keyed("x").bits(0),
                                      a.keyed("xy").bits(0)};
  EXPECT_EQ(drawn.size(), 10u);
}

TEST(CounterRandom, UniformFillsTheUnitInterval) {
  const CounterRandom random(3);
  constexpr int kDraws = 20000;
  double sum = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double value = random.uniform(i);
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
  }
  // Standard deviation of the mean: sqrt(1/12/20000) = 0.002; five of them.
  EXPECT_NEAR(sum / kDraws, 0.5, 0.01);
}

TEST(CounterRandom, BelowIsEven) {
  const CounterRandom random(4);
  std::array<int, 6> counts{};
  for (int i = 0; i < 60000; ++i) ++counts.at(random.below(i, 6));
  // Each is binomial, 10000 ± sqrt(60000 * 1/6 * 5/6) = 91; five of them.
  for (const int count : counts) EXPECT_NEAR(count, 10000, 457);
  EXPECT_EQ(random.below(0, 1), 0u);
}

}  // namespace
}  // namespace eventgan

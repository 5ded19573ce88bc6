#include "manifests/values/pair_key.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace eventgan {
namespace {

double threshold(std::array<double, 2> range, const PairKey& key) {
  GeneratorSpec spec;
  spec.threshold = ThresholdSpec{.range = range};
  return pair_threshold(spec, key).value().mean;
}

TEST(PairThreshold, IsNoneUnlessToldAndOfOneNumberThatNumber) {
  EXPECT_EQ(pair_threshold({}, {1, "mpii", "a"}), std::nullopt);
  for (const double told : {0.01, 0.25, 0.3, 5.0}) {
    EXPECT_EQ(threshold({told, told}, {1, "mpii", "a"}), told);
  }
}

TEST(PairThreshold, IsLogUniform) {
  // ln of it is uniform from ln 0.1 to ln 0.9, about ln 0.3, with a deviation of ln 9 / sqrt(12).
  constexpr int kDraws = 4000;
  double sum = 0, least = 1, most = 0;
  for (int i = 0; i < kDraws; ++i) {
    const std::string id = std::to_string(i);
    const double drawn = threshold({0.1, 0.9}, {1, "mpii", id});
    least = std::min(least, drawn);
    most = std::max(most, drawn);
    sum += std::log(drawn);
  }
  EXPECT_NEAR(sum / kDraws, std::log(0.3), 5 * std::log(9) / std::sqrt(12.0 * kDraws));
  EXPECT_GE(least, 0.1);
  EXPECT_LT(least, 0.102);
  EXPECT_LE(most, 0.9);
  EXPECT_GT(most, 0.88);
}

TEST(PairThreshold, FollowsFromSeedDatasetAndSample) {
  const double drawn = threshold({0.1, 0.9}, {1, "mpii", "a"});
  EXPECT_EQ(threshold({0.1, 0.9}, {1, "mpii", "a"}), drawn);
  EXPECT_NE(threshold({0.1, 0.9}, {2, "mpii", "a"}), drawn);
  EXPECT_NE(threshold({0.1, 0.9}, {1, "frames", "a"}), drawn);
  EXPECT_NE(threshold({0.1, 0.9}, {1, "mpii", "b"}), drawn);
  EXPECT_NE(threshold({0.1, 0.9}, {1, "mpii", "a", "val"}), drawn);
}

TEST(SourceKey, TellsSourcesOfOneKindApart) {
  const auto source = [](const char* root, const char* split, DatasetKind kind) {
    SourceSpec spec;
    spec.root = root;
    spec.split = split;
    spec.dataset = kind;
    return spec;
  };
  const SourceSpec train = source("b", "train", DatasetKind::kFrames);
  const SourceSpec more = source("c", "train", DatasetKind::kFrames);
  const SourceSpec val = source("a", "val", DatasetKind::kFrames);
  const SourceSpec cars = source("a", "train", DatasetKind::kKittiObject);
  // The only one has none, whatever sources of other splits and kinds there are, and wherever.
  EXPECT_EQ(source_key({train}, 0), "");
  EXPECT_EQ(source_key({val, cars, more, train}, 1), "");
  EXPECT_EQ(source_key({val, cars, more, train}, 0), "val");
  EXPECT_EQ(source_key({val, cars, more, train}, 2), "");
  EXPECT_EQ(source_key({val, cars, more, train}, 3), "\n1");
  EXPECT_EQ(source_key({val, source("b", "val", DatasetKind::kFrames)}, 1), "val\n1");
  // A source that is taken twice has the same frames, and counts once.
  EXPECT_EQ(source_key({train, train, more}, 1), "");
  EXPECT_EQ(source_key({train, train, more}, 2), "\n1");
}

TEST(ThresholdSpec, IsOfItsPolaritiesAndSpreadAsTheDefaultsAre) {
  EXPECT_EQ(ThresholdSpec().applied({}, ContrastThreshold{0.2}), SensorSpec());
  // The negative one is a quarter of the positive one: 0.8 / sqrt(0.25) and 0.8 sqrt(0.25).
  const SensorSpec wide = ThresholdSpec{.spread = 0.5}.applied({.leak_rate_hz = 1}, {0.8, 0.25});
  EXPECT_EQ(wide, (SensorSpec{.positive_threshold = 1.6,
                              .negative_threshold = 0.4,
                              .threshold_spread = 0.5,
                              .leak_rate_hz = 1}));
}

}  // namespace
}  // namespace eventgan

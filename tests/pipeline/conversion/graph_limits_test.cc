#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "pipeline/conversion/conversion_run.h"
#include "tests/testing/fake_generator.h"

namespace eventgan {
namespace {

constexpr std::size_t kMuch = std::size_t{1} << 50;
const testing::FakeGenerator kGenerator;

/// Needs a kilobyte for each pixel.
class LargeGenerator final : public Generator {
 public:
  int bins() const override { return 9; }
  void generate(std::span<const float>, ImageSize, std::span<float>) const override {}
  std::string description() const override { return "large"; }
  std::size_t working_bytes(ImageSize size) const override { return 1024 * size.pixel_count(); }
};

TEST(GraphLimits, KeepThreadsBusyWithSmallSamples) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  const GraphLimits limits = graph_limits({&small}, kGenerator, 3, kMuch);
  EXPECT_EQ(limits.threads, 3);
  EXPECT_EQ(limits.in_flight, 16u);  // four for each thread and four more
  EXPECT_EQ(graph_limits({}, kGenerator, 3, kMuch).in_flight, 16u);
}

TEST(GraphLimits, HoldNoMoreOfTheLargestThanAGibibyte) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  // 18 channels of 1024 x 1024 float32, twice: 144 MiB, so seven in a gibibyte.
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  EXPECT_EQ(graph_limits({&small, &large, &small}, kGenerator, 1, kMuch).in_flight, 7u);
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, kMuch).in_flight,
            9u);  // never fewer than threads + 1
}

TEST(GraphLimits, RunNoMoreGeneratorsAtOnceThanFitIntoThreeQuartersOfTheMemory) {
  const PlannedShard small{"s.h5", 0, {32, 32}, {}};
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  const std::size_t gibibyte = std::size_t{1} << 30;
  const LargeGenerator generator;
  EXPECT_EQ(graph_limits({&small}, generator, 64, 8 * gibibyte).generators, 64);
  EXPECT_EQ(graph_limits({&small, &large}, generator, 64, 8 * gibibyte).generators, 6);
  EXPECT_EQ(graph_limits({&large}, generator, 64, gibibyte).generators, 1);  // one always
  EXPECT_EQ(graph_limits({&large}, kGenerator, 64, gibibyte).generators, 64);
  EXPECT_EQ(graph_limits({}, generator, 64, 0).generators, 1);
}

TEST(GraphLimits, HoldFewerSamplesWhereTheyTakeMoreThanHalfOfTheMemory) {
  // 144 MiB each (see above): seven in a gibibyte.
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  const std::size_t gibibyte = std::size_t{1} << 30;
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, 2 * gibibyte).in_flight, 7u);
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, 1000).in_flight, 1u);
}

TEST(CheckPairsFit, NamesThePairThatDoesNot) {
  const PlannedSample sample{"id7", "", "", {{"a.png"}, {"b.png"}}, ""};
  const PlannedShard small{"s.h5", 0, {32, 32}, {sample}};
  const PlannedShard large{"l.h5", 0, {1024, 512}, {sample}};
  const LargeGenerator generator;
  // 1024 x 512 pixels with a kilobyte of working memory and a volume of 18 x 4 bytes each.
  const std::size_t needed = std::size_t{1024} * 512 * (1024 + 18 * 4);
  check_pairs_fit({&small, &large}, generator, needed);
  EXPECT_THAT(
      [&] {
        check_pairs_fit({&small, &large}, generator, needed - 1);
      },
      ::testing::ThrowsMessage<std::runtime_error>(::testing::AllOf(
          ::testing::HasSubstr(std::to_string(needed - 1) + " bytes, got 512x1024"),
          ::testing::HasSubstr("about " + std::to_string(needed)),
          ::testing::HasSubstr("in a.png and b.png (id7)"))));
}

}  // namespace
}  // namespace eventgan

#include "pipeline/conversion/earlier_shards.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "tests/pipeline/conversion/small_conversion.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A folder of three whole shards that tests damage.
class EarlierShardsTest : public testing::SmallConversion {
 protected:
  EarlierShardsTest() {
    run();
    frozen_ = read_frozen_plan(folder_ / "out");
    for (const PlannedShard& shard : frozen_.plan.shards) all_.push_back(&shard);
  }

  EarlierShards check(int threads = 2) const {
    return check_earlier_shards(folder_ / "out", frozen_, all_, {threads, {}, {}});
  }

  std::filesystem::path shard(int number) const {
    return out(frozen_.plan.shards[static_cast<std::size_t>(number)].name);
  }
  std::filesystem::path marker(int number) const {
    return out(marker_name(frozen_.plan.shards[static_cast<std::size_t>(number)].name));
  }

  void flip_a_bit(int number) const {
    std::string bytes = testing::read_file(shard(number));
    bytes[bytes.size() / 2] ^= 4;
    testing::write_file(shard(number), bytes);
  }

  FrozenPlan frozen_;
  std::vector<const PlannedShard*> all_;
};

TEST_F(EarlierShardsTest, WholeShardsAreDone) {
  for (const int threads : {1, 4}) {
    const EarlierShards earlier = check(threads);
    ASSERT_EQ(earlier.done.size(), 3u);
    EXPECT_EQ(earlier.done[1].shard, all_[1]);
    EXPECT_EQ(earlier.done[2].marker.samples, 3);
    EXPECT_THAT(earlier.left, IsEmpty());
    EXPECT_THAT(earlier.faults, IsEmpty());
  }
}

TEST_F(EarlierShardsTest, AMissingShardIsLeftWithoutAWord) {
  std::filesystem::remove(shard(1));
  std::filesystem::remove(marker(1));
  EXPECT_THAT(check().left, ElementsAre(all_[1]));
  EXPECT_THAT(check().faults, IsEmpty());
}

TEST_F(EarlierShardsTest, AnyDamageIsLeftAndNamed) {
  flip_a_bit(0);
  std::filesystem::remove(marker(1));
  std::filesystem::resize_file(shard(2), 7);
  const EarlierShards earlier = check();
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.left, ElementsAre(all_[0], all_[1], all_[2]));
  EXPECT_THAT(earlier.faults,
              ElementsAre(HasSubstr(shard(0).string()), HasSubstr(shard(1).stem().string()),
                          HasSubstr(shard(2).string())));
  // Only its bytes tell.
  EXPECT_THAT(earlier.distrusted, ElementsAre(::testing::Pair(all_[0]->name, "")));
}

TEST_F(EarlierShardsTest, ConvertSaysSoAndMakesThemAgain) {
  const auto whole = shards();
  flip_a_bit(0);
  testing::write_file(marker(1), "{");
  testing::write_file(shard(2), "");
  std::vector<std::string> warnings;
  ConversionOptions warned = options();
  warned.warn = [&](const std::string& text) { warnings.push_back(text); };
  const ConversionReport report = run(warned);
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_THAT(warnings, ::testing::Each(::testing::EndsWith("; it is made again")));
  EXPECT_THAT(warnings[0], HasSubstr("SHA-256"));
  EXPECT_EQ(report.damaged.size(), 3u);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_before, 0);
  EXPECT_EQ(shards(), whole);
  EXPECT_THAT(check().left, IsEmpty());
}

TEST_F(EarlierShardsTest, AMarkerWithCountsThatAreNotTheShardsIsNamedAndMadeAgain) {
  const auto whole = shards();
  ShardMarker wrong = parse_marker(testing::read_file(marker(0)), "");
  std::swap(wrong.gaps.begin()->second, wrong.gaps[6]);  // as many samples, all of another gap
  wrong.gaps.erase(wrong.gaps.begin());
  testing::write_file(marker(0), to_json(wrong));
  const EarlierShards earlier = check();
  EXPECT_THAT(earlier.left, ElementsAre(all_[0]));
  EXPECT_THAT(earlier.faults, ElementsAre(::testing::AllOf(HasSubstr(marker(0).string()),
                                                           HasSubstr("expected samples by gap "),
                                                           HasSubstr("got 6: "))));
  const ConversionReport report = run();
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.shards_done_before, 2);
  EXPECT_EQ(shards(), whole);
  EXPECT_THAT(check().left, IsEmpty());
}

TEST_F(EarlierShardsTest, ARequestToStopLeavesTheRestOut) {
  const EarlierShards earlier =
      check_earlier_shards(folder_ / "out", frozen_, all_, {1, [] { return true; }, {}});
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.faults, IsEmpty());  // not looked at is not damaged
}

TEST_F(EarlierShardsTest, OfNoShardsAreNone) {
  const EarlierShards earlier = check_earlier_shards(folder_ / "out", frozen_, {}, {4, {}, {}});
  EXPECT_THAT(earlier.done, IsEmpty());
  EXPECT_THAT(earlier.left, IsEmpty());
}

TEST_F(EarlierShardsTest, QuarantinedSamplesOfDoneShardsAreCounted) {
  EXPECT_EQ(count_quarantined(folder_ / "out", frozen_, all_, {2, {}, {}}), 0);
  testing::write_file(picture(1), "");  // spoils pairs 0 and 1
  manifest_.errors = {ErrorPolicy::kQuarantine, 100, 1.0};
  run("spoilt");
  const FrozenPlan spoilt = read_frozen_plan(folder_ / "spoilt");
  EXPECT_EQ(count_quarantined(folder_ / "spoilt", spoilt, all_, {2, {}, {}}), 2);
  std::filesystem::remove(out(marker_name(all_[0]->name), "spoilt"));
  EXPECT_EQ(count_quarantined(folder_ / "spoilt", spoilt, all_, {2, {}, {}}), 0);
}

}  // namespace
}  // namespace eventgan

#include "manifests/values/job.h"

#include <gtest/gtest.h>

#include <set>

#include "manifests/values/weights.h"
#include "manifests/values/words.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// Every word names one value, and to_string gives it back.
template <class T, std::size_t N>
void expect_one_to_one(const std::array<Word<T>, N>& words) {
  std::set<std::string_view> names;
  std::set<T> values;
  for (const Word<T>& entry : words) {
    EXPECT_EQ(to_string(entry.value), entry.word);
    EXPECT_EQ(value_of_word(words, entry.word), entry.value);
    names.insert(entry.word);
    values.insert(entry.value);
  }
  EXPECT_EQ(names.size(), N);
  EXPECT_EQ(values.size(), N);
}

TEST(JobWords, GoThereAndBack) {
  expect_one_to_one(kDatasetWords);
  expect_one_to_one(kLayoutWords);
  expect_one_to_one(kSideWords);
  expect_one_to_one(kChoiceWords);
  expect_one_to_one(kFitWords);
  expect_one_to_one(kGreyWords);
  expect_one_to_one(kGeneratorWords);
  expect_one_to_one(kPrecisionWords);
  expect_one_to_one(kDeviceWords);
  expect_one_to_one(kScopeWords);
  expect_one_to_one(kNormalizationWords);
  expect_one_to_one(kStoredTypeWords);
  expect_one_to_one(kPolicyWords);
  expect_one_to_one(kPhaseWords);
  EXPECT_EQ(value_of_word(kPhaseWords, "Flow"), std::nullopt);
}

TEST(JobWords, AreThoseThatFilesHoldAndThePeopleWrite) {
  EXPECT_EQ(word_of(kEngineWords, std::optional<Engine>()), "auto");
  EXPECT_EQ(word_of(kPrecisionChoiceWords, std::optional<Precision>()), "auto");
  EXPECT_EQ(to_string(Engine::kTorch), "torch");
  EXPECT_EQ(to_string(Engine::kOnednn), "onednn");
  // Shards and plans hold these; a change is a change of the formats.
  EXPECT_EQ(to_string(DatasetKind::kKittiObject), "kitti_object");
  EXPECT_EQ(to_string(DatasetKind::kHuman36m), "human36m");
  EXPECT_EQ(to_string(PairSide::kAround), "around");
  EXPECT_EQ(to_string(GreyOrder::kBeforeResize), "before_resize");
  EXPECT_EQ(to_string(Normalization::kEta98), "eta98");
  EXPECT_EQ(to_string(StoredType::kFloat16), "float16");
  EXPECT_THROWS(to_string(static_cast<StoredType>(99)), std::invalid_argument,
                "expected a value of the enumeration, got another number");
}

TEST(WeightsName, KnowsTheWordsAndTakesTheRestForPaths) {
  using enum WeightsOrigin;
  for (const auto& [text, name] : {std::pair("shipped", WeightsName{kShipped, "", {}}),
                                   {"shipped:16", {kShipped, "", 16}},
                                   {"shipped:sensor", {kShipped, "", kSensorWeights}},
                                   {"untrained:1", {kUntrained, "", 1}},
                                   {"untrained:64", {kUntrained, "", 64}}}) {
    EXPECT_EQ(parse_weights_name(text), name) << text;
  }
  for (const char* path : {"w.safetensors", "../a b/w", "shipped.safetensors", "untrained", ":"}) {
    EXPECT_EQ(parse_weights_name(path), (WeightsName{kFile, path, {}})) << path;
  }
}

TEST(WeightsName, RefusesWhatNamesNothing) {
  using namespace std::string_view_literals;
  for (const auto text : {""sv, "a\0b"sv, "shipped:"sv, "shipped:0"sv, "shipped:08"sv,
                          "shipped:8x"sv, "shipped:-8"sv, "shipped:+8"sv, "shipped: 8"sv,
                          "untrained:"sv, "untrained:65"sv, "untrained:99999999999999999999"sv}) {
    EXPECT_EQ(parse_weights_name(text), std::nullopt) << text;
  }
}

TEST(BeyondLimits, CountAndFractionBothBindAndThePolicyFailAllowsNone) {
  const ErrorSpec errors{ErrorPolicy::kQuarantine, 3, 0.1}, none{ErrorPolicy::kFail, 100, 1};
  EXPECT_FALSE(beyond_limits(errors, 0, 0));
  EXPECT_FALSE(beyond_limits(errors, 3, 30));
  EXPECT_TRUE(beyond_limits(errors, 3, 29));  // 10.3 %
  EXPECT_TRUE(beyond_limits(errors, 4, 1000));
  EXPECT_FALSE(beyond_limits(none, 0, 10));
  EXPECT_TRUE(beyond_limits(none, 1, 10));
  EXPECT_EQ(limits_text({ErrorPolicy::kQuarantine, 3, 0.25}, 8),
            "at most 2 quarantined pairs (errors in the manifest)");
  EXPECT_EQ(limits_text(none, 8),
            "no quarantined pair (errors.policy in the manifest is \"fail\")");
}

TEST(BeyondLimits, OfFewSamplesOneMayFail) {
  const ErrorSpec errors;  // 1 %
  for (const std::int64_t planned : {2, 9, 44, 99, 100, 199}) {
    EXPECT_EQ(most_quarantined(errors, planned), 1) << planned;
  }
  EXPECT_EQ(most_quarantined(errors, 200), 2);
  EXPECT_EQ(most_quarantined(errors, 1), 0);  // then nothing is made
  EXPECT_EQ(most_quarantined({ErrorPolicy::kQuarantine, 100, 0}, 44), 0);
  EXPECT_EQ(most_quarantined({ErrorPolicy::kQuarantine, 0, 1}, 44), 0);
}

}  // namespace
}  // namespace eventgan

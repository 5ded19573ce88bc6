#include <gtest/gtest.h>

#include <set>

#include "manifests/job_words_internal.h"

namespace eventgan {
namespace {

/// Every word names one value, and to_string gives it back.
template <class T, std::size_t N>
void expect_one_to_one(const std::array<Word<T>, N>& words) {
  std::set<std::string_view> names;
  std::set<T> values;
  for (const Word<T>& entry : words) {
    EXPECT_EQ(to_string(entry.value), entry.word);
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
  expect_one_to_one(kNormalizationWords);
  expect_one_to_one(kStoredTypeWords);
  expect_one_to_one(kPolicyWords);
}

TEST(JobWords, NameTheEnginesAndTheProgramsChoice) {
  EXPECT_EQ(word_of(kEngineWords, std::optional<Engine>()), "auto");
  EXPECT_EQ(to_string(Engine::kTorch), "torch");
  EXPECT_EQ(to_string(Engine::kOnednn), "onednn");
}

TEST(JobWords, AreThoseThatFilesHold) {
  // Shards and plans hold these; a change is a change of the formats.
  EXPECT_EQ(to_string(DatasetKind::kKittiObject), "kitti_object");
  EXPECT_EQ(to_string(DatasetKind::kHuman36m), "human36m");
  EXPECT_EQ(to_string(PairSide::kAround), "around");
  EXPECT_EQ(to_string(GreyOrder::kBeforeResize), "before_resize");
  EXPECT_EQ(to_string(Normalization::kEta98), "eta98");
  EXPECT_EQ(to_string(StoredType::kFloat16), "float16");
}

TEST(JobWords, ANumberThatIsNoValueHasNone) {
  EXPECT_THROW(to_string(static_cast<StoredType>(99)), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan

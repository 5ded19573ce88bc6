#include "pipeline/tradeoff/measure_computation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "pipeline/runtime/memory.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

const std::vector<StoredType> kTypes{StoredType::kFloat32, StoredType::kUint8};

Computation network(const std::string& weights) {
  return {GeneratorKind::kNetwork, weights, Precision::kFloat32, 1};
}

/// Four pairs.
class MeasureComputation : public ::testing::Test {
 protected:
  const testing::TemporaryFolder folder_;
  const JobManifest manifest_ = testing::make_small_job(folder_, 5);
  const ComparedJob job_{manifest_, 4, nullptr};
  std::atomic<int> calls_ = 0;
  const std::function<void()> each_ = [this] { ++calls_; };
};

TEST_F(MeasureComputation, OnlyStoringTheReferenceLoses) {
  ComparedPairs pairs(job_, network("untrained:2"));
  const auto own = measure_losses(pairs, network("untrained:2"), kTypes, 2, each_);
  ASSERT_EQ(own.size(), 2u);
  EXPECT_EQ(own[0].size(), 4u);
  EXPECT_EQ(overall_loss(own[0]).largest, 0);
  EXPECT_GT(overall_loss(own[1]).relative_l2, 0);
  EXPECT_LT(overall_loss(own[1]).relative_l2,
            0.01);  // half of a 255th of the largest value at most
  EXPECT_EQ(calls_, 4);
  const auto other = measure_losses(pairs, network("untrained:1"), kTypes, 2, each_);
  EXPECT_GT(overall_loss(other[0]).relative_l2, 0.1);
}

TEST_F(MeasureComputation, PairsThatCannotBeReadAreLeftOut) {
  std::filesystem::remove(folder_ / "clip" / "f_10.png");  // of the first pair alone
  ComparedPairs pairs(job_, network("untrained:1"));
  const auto losses = measure_losses(pairs, network("untrained:1"), kTypes, 2, each_);
  EXPECT_EQ(losses[0].size(), 3u);
  EXPECT_EQ(losses[1].size(), 3u);
  EXPECT_EQ(calls_, 3);
  take_turn(pairs, network("untrained:1"), kTypes, 2, each_);
  EXPECT_EQ(calls_, 3 + 3);
}

TEST_F(MeasureComputation, OneTurnServesAllStoredTypes) {
  ComparedPairs pairs(job_, network("untrained:1"));
  const std::vector<RoundCost> costs = take_turn(pairs, network("untrained:1"), kTypes, 2, each_);
  EXPECT_EQ(calls_, 4);
  ASSERT_EQ(costs.size(), 2u);
  EXPECT_EQ(costs[0].generator_s, costs[1].generator_s);
  EXPECT_LT(costs[1].stored_bytes, costs[0].stored_bytes);
}

TEST(TakeTurn, ThePeakOfMemoryDoesNotGrowWithThePairsAndTheStoredTypes) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizers keep what is freed";
#endif
  if (!restart_peak_memory()) GTEST_SKIP() << "the kernel keeps the peak";
  const testing::TemporaryFolder folder;
  std::string text = testing::make_small_job(folder, 12).text;
  text.replace(text.find("\"preset\""), 0, R"("width": 160, "height": 120, )");
  text.replace(text.find("[1]"), 3, "[1, 2, 3, 4, 5, 6]");
  text.replace(text.find("\"one\""), 5, "\"all\"");
  const JobManifest manifest = parse_job_manifest(text, folder.path(), "manifest.json");
  const Computation computation = network("untrained:1");
  const auto peak = [&](int count) {
    const ComparedJob job(manifest, count, nullptr);
    ComparedPairs pairs(job, computation);
    EXPECT_EQ(std::ssize(pairs.reference().pairs), count);
    constexpr StoredType kAll[] = {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8};
    return take_turn(pairs, computation, kAll, 2, [] {}).front().peak_bytes;
  };
  constexpr double kVolume = 18 * 160 * 120 * sizeof(float);
  const double few = peak(5);
  ASSERT_GT(few, kVolume);
  // How many pairs are in flight, and what the heap keeps of them, differs from run to run by some
  // ten volumes; whoever held one volume a pair would need 45 more.
  EXPECT_LT(peak(50) - few, 25 * kVolume);
}

}  // namespace
}  // namespace eventgan

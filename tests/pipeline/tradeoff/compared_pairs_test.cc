#include "pipeline/tradeoff/compared_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

/// Six pairs of 30x20 pixels, of which every other one is compared.
class ComparedPairsTest : public ::testing::Test {
 protected:
  ComparedPairsTest() : job_(manifest_, 3, [this] { return stop_; }) {}

  bool stop_ = false;
  const testing::TemporaryFolder folder_;
  const JobManifest manifest_ = testing::make_small_job(folder_, 7);
  const ComparedJob job_;
  const Computation reference_{GeneratorKind::kNetwork, "untrained:1", Precision::kFloat32, 1};
};

TEST_F(ComparedPairsTest, AreSpreadOverThePlan) {
  std::vector<std::string> ids;
  for (const CalibrationSample& sample : job_.samples) ids.push_back(sample.planned().sample_id);
  EXPECT_THAT(ids, ElementsAre("f_11", "f_13", "f_15"));
  EXPECT_EQ(job_.whole, (ImageSize{20, 30}));
}

TEST_F(ComparedPairsTest, AreHeldInTheReferencesSizeAndOneOther) {
  ComparedPairs pairs(job_, reference_);
  EXPECT_EQ(&pairs.of(1), &pairs.reference());
  constexpr double kFrames = 3 * 2 * sizeof(float);
  EXPECT_EQ(pairs.held_bytes(), kFrames * 30 * 20);
  for (const double size : {0.8, 1.2}) {
    const SizedPairs& sized = pairs.of(size);
    ASSERT_EQ(sized.pairs.size(), 3u);
    const ImageSize volume = sized.pairs[0].shard->volume_size;
    EXPECT_EQ(volume, (ImageSize{size < 1 ? 16 : 24, size < 1 ? 24 : 36}));
    EXPECT_EQ(sized.pairs[0].prepared.content, volume);
    EXPECT_EQ(pairs.held_bytes(), kFrames * (30 * 20 + static_cast<double>(volume.pixel_count())));
  }
}

TEST_F(ComparedPairsTest, ThoseThatCannotBeReadKeepTheirPlaceAndAStopEndsTheReading) {
  std::filesystem::remove(folder_ / "clip" / "f_13.png");
  const ComparedPairs pairs(job_, reference_);
  std::vector<bool> failed;
  for (const SampleMessage& pair : pairs.reference().pairs) failed.push_back(pair.failed());
  EXPECT_THAT(failed, ElementsAre(false, true, false));
  stop_ = true;
  EXPECT_THROWS(ComparedPairs(job_, reference_), Stopped, "stopped on request");
}

}  // namespace
}  // namespace eventgan

#include "pipeline/folder/preview_shard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "pipeline/conversion/convert.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"

namespace eventgan {
namespace {

class PreviewShard : public ::testing::Test {
 protected:
  PreviewShard() {
    ConversionOptions options;
    options.output = folder_ / "out";
    options.threads = 1;
    convert(testing::make_small_job(folder_, 5), testing::FakeGenerator(), "weights", options);
  }

  std::vector<std::filesystem::path> draw(const std::string& samples, int count = 8) {
    PreviewOptions options;
    options.out = folder_ / "pictures";
    options.samples = samples;
    options.count = count;
    warnings_.clear();
    return preview_shard(folder_ / "out" / "job-train-00000-of-00001.h5", options, warnings_);
  }

  testing::TemporaryFolder folder_;
  std::vector<std::string> warnings_;
};

TEST_F(PreviewShard, WritesAPictureForEachChosenSlot) {
  const auto pictures = draw("1,3");
  ASSERT_EQ(pictures.size(), 2u);
  EXPECT_EQ(pictures[1].filename(), "job-train-00000-of-00001_0003.png");
  for (const auto& picture : pictures) EXPECT_GT(std::filesystem::file_size(picture), 100u);
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  EXPECT_EQ(draw("", 2).size(), 2u);
}

TEST_F(PreviewShard, WarnsOfFramesThatAreGone) {
  std::filesystem::remove_all(folder_ / "clip");
  EXPECT_EQ(draw("0").size(), 1u);
  EXPECT_THAT(warnings_, ::testing::Each(::testing::HasSubstr("clip/f_1")));
  EXPECT_EQ(warnings_.size(), 2u);
}

TEST_F(PreviewShard, RefusesASlotThatIsNotThere) { EXPECT_THROW(draw("4"), UsageError); }

}  // namespace
}  // namespace eventgan

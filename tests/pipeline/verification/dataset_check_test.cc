#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/conversion/convert.h"
#include "pipeline/folder/finalize.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/folder/verify_folder.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class DatasetFaults : public ::testing::Test {
 protected:
  DatasetFaults() {
    ConversionOptions options;
    options.output = out_;
    options.threads = 1;
    convert(testing::make_small_job(folder_, 7), testing::FakeGenerator(), "weights", options);
    finalize(out_, {});
  }

  /// Changes some bytes of a file.
  void change(const std::filesystem::path& file, const std::string& from, const std::string& to) {
    std::string bytes = testing::read_file(file);
    bytes.replace(bytes.find(from), from.size(), to);
    testing::write_file(file, bytes);
  }

  std::vector<std::string> faults(bool sound = true) const {
    const FrozenOutline frozen = read_frozen_outline(out_);
    std::vector<ShardState> shards = scan_shards(out_, frozen.plan.shards, frozen.hash);
    for (ShardState& shard : shards) {
      if (!sound) shard.faults = {"not what its marker says"};
    }
    return dataset_faults(out_, frozen, shards);
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path out_ = folder_ / "out";
  const std::filesystem::path description_ = out_ / "dataset.json";
  const std::filesystem::path view_ = out_ / "dataset.h5";
};

TEST_F(DatasetFaults, AreNoneAfterFinalizeAndBeforeIt) {
  EXPECT_THAT(faults(), IsEmpty());
  std::filesystem::remove(description_);
  std::filesystem::remove(view_);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(DatasetFaults, OneWithoutTheOtherIsNamed) {
  const std::string bytes = testing::read_file(view_);
  std::filesystem::remove(view_);
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr(description_.string()),
                                          HasSubstr("expected dataset.h5 beside it"))));
  testing::write_file(view_, bytes);
  std::filesystem::remove(description_);
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr(view_.string()),
                                          HasSubstr("expected dataset.json beside it"))));
}

TEST_F(DatasetFaults, AViewWithOtherBytesIsNamed) {
  std::string bytes = testing::read_file(view_);
  bytes[bytes.size() / 2] ^= 1;
  testing::write_file(view_, bytes);
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr(description_.string()), HasSubstr("\"sha256\""),
                                          HasSubstr("in line"))));
}

TEST_F(DatasetFaults, ADescriptionThatTheMarkersDoNotGiveIsNamedWithItsFirstDifference) {
  const std::string text = testing::read_file(description_);
  change(description_, "\"samples\": 6", "\"samples\": 7");
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("\"samples\": 6"), HasSubstr(", got \"samples"),
                                HasSubstr("\"samples\": 7"), HasSubstr("eventgan finalize"))));
  for (const std::string& torn : {text.substr(0, text.size() / 2), std::string(), text + "\n"}) {
    testing::write_file(description_, torn);
    EXPECT_THAT(faults(), ElementsAre(HasSubstr(description_.string())));
  }
}

TEST_F(DatasetFaults, AShardThatHasChangedSinceIsNamed) {
  std::filesystem::remove(out_ / "job-train-00001-of-00002.json");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(description_.string())));
  std::filesystem::remove(out_ / "job-train-00000-of-00002.json");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("expected committed shards beside it, got none")));
}

TEST_F(DatasetFaults, WithoutASoundShardThereIsNothingToCompareWith) {
  EXPECT_THAT(faults(false),
              ElementsAre(AllOf(HasSubstr(description_.string()),
                                HasSubstr("expected a sound shard of each source"))));
}

}  // namespace
}  // namespace eventgan

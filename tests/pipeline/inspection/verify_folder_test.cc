#include "pipeline/inspection/verify_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "pipeline/conversion/convert.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class VerifyFolder : public ::testing::Test {
 protected:
  VerifyFolder() {
    ConversionOptions options;
    options.output = out_;
    options.threads = 1;
    convert(testing::make_small_job(folder_, 7), testing::FakeGenerator(), "weights", options);
  }

  std::vector<std::string> faults() const { return verify_folder(out_).faults; }

  testing::TemporaryFolder folder_;
  const std::filesystem::path out_ = folder_ / "out";
  const std::filesystem::path shard_ = out_ / "job-train-00001-of-00002.h5";
  const std::filesystem::path marker_ = out_ / "job-train-00001-of-00002.json";
};

TEST_F(VerifyFolder, FindsNothingInASoundFolder) {
  const FolderCheck check = verify_folder(out_);
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_EQ(check.shards, 2);
  EXPECT_EQ(check.samples, 6);
  EXPECT_EQ(check.valid, 6);
}

TEST_F(VerifyFolder, NamesAMissingMarkerAndAMissingShard) {
  std::filesystem::remove(marker_);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("not committed")));
  std::filesystem::remove(shard_);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(marker_.string())));
}

TEST_F(VerifyFolder, NamesADamagedShard) {
  std::string bytes = testing::read_file(shard_);
  bytes[bytes.size() / 2] ^= 1;
  testing::write_file(shard_, bytes);
  EXPECT_THAT(faults(), ::testing::Contains(HasSubstr(shard_.string())));
}

TEST_F(VerifyFolder, NamesATornAndAForeignMarker) {
  const std::string text = testing::read_file(marker_);
  testing::write_file(marker_, text.substr(0, text.size() / 2));
  EXPECT_THAT(faults(), ElementsAre(HasSubstr(marker_.string())));
  testing::write_file(marker_, testing::read_file(out_ / "job-train-00000-of-00002.json"));
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("got another one")));
}

TEST_F(VerifyFolder, NamesAFileThatIsNotOfThePlan) {
  testing::write_file(out_ / "old.h5", "");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("old.h5")));
}

TEST_F(VerifyFolder, NeedsAPlan) {
  std::filesystem::remove(out_ / "plan.json");
  EXPECT_THROW(faults(), InputError);
}

}  // namespace
}  // namespace eventgan

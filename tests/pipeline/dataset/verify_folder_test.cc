#include "pipeline/dataset/verify_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/files/atomic_file.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/dataset/finalize.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/image_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::texts_with;

TEST(StrayFiles, AreThoseThatLookLikeThePlansAndAreNot) {
  const testing::TemporaryFolder folder;
  PlanOutline plan;
  plan.shards = {{"job-train-00000-of-00001.h5", 0, {2, 2}, 1}};
  for (const char* name :
       {"job-train-00000-of-00001.h5", "job-train-00000-of-00001.json", "plan.json", "run.json",
        "amendments.json", "dataset.json", "dataset.h5", "notes.txt", "images/deeper.h5",
        ".job-train-00000-of-00001.h5.host.1.1.tmp"}) {
    testing::write_file(folder / name, "");
  }
  testing::write_file(folder / "mine.json", R"({ "format": "eventgan-manifest", // a job
                                                 "version": 1 })");
  EXPECT_THAT(stray_files(folder.path(), plan), IsEmpty());

  testing::write_file(folder / "old.h5", "");
  testing::write_file(folder / "job-train-00000-of-00009.json",
                      R"({"format": "eventgan-commit-record"})");
  std::filesystem::create_directory(folder / "folder.json");
  const auto fault = [&](const char* name) {
    return (folder / name).string() + ": expected files of the plan only, got another file";
  };
  EXPECT_THAT(
      stray_files(folder.path(), plan),
      ElementsAre(fault("folder.json"), fault("job-train-00000-of-00009.json"), fault("old.h5")));
}

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
      if (!sound) shard.faults = {"not what its commit record says"};
    }
    return dataset_faults(out_, frozen, shards);
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path out_ = folder_ / "out";
  const std::filesystem::path description_ = out_ / "dataset.json";
  const std::filesystem::path view_ = out_ / "dataset.h5";
};

TEST_F(DatasetFaults, AreOfOneWithoutTheOtherAndOfAViewWithOtherBytes) {
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_THAT(faults(false),
              texts_with({{description_.string(), "expected an intact shard of each source"}}));
  std::string bytes = testing::read_file(view_);
  const std::string text = testing::read_file(description_);
  std::filesystem::remove(view_);
  EXPECT_THAT(faults(), texts_with({{description_.string(), "expected dataset.h5 beside it"}}));
  std::filesystem::remove(description_);
  EXPECT_THAT(faults(), IsEmpty()) << "before finalize";
  testing::write_file(view_, bytes);
  EXPECT_THAT(faults(), texts_with({{view_.string(), "expected dataset.json beside it"}}));
  testing::write_file(description_, text);
  bytes[bytes.size() / 2] ^= 1;
  testing::write_file(view_, bytes);
  EXPECT_THAT(faults(), texts_with({{description_.string(), "\"sha256\"", "in line"}}));
}

TEST_F(DatasetFaults, ADescriptionThatTheCommitRecordsDoNotGiveIsNamedWithItsFirstDifference) {
  const std::string text = testing::read_file(description_);
  change(description_, "\"samples\": 6", "\"samples\": 7");
  EXPECT_THAT(
      faults(),
      texts_with({{"\"samples\": 6", ", got \"samples", "\"samples\": 7", "eventgan finalize"}}));
  for (const std::string& torn : {text.substr(0, text.size() / 2), std::string(), text + "\n"}) {
    testing::write_file(description_, torn);
    EXPECT_THAT(faults(), texts_with({description_.string()}));
  }
}

TEST_F(DatasetFaults, AShardThatHasChangedSinceIsNamed) {
  std::filesystem::remove(out_ / "job-train-00001-of-00002.json");
  EXPECT_THAT(faults(), texts_with({description_.string()}));
  std::filesystem::remove(out_ / "job-train-00000-of-00002.json");
  EXPECT_THAT(faults(), texts_with({"expected committed shards beside it, got none"}));
}

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
  const std::filesystem::path record_ = out_ / "job-train-00001-of-00002.json";
};

TEST_F(VerifyFolder, NamesDamagedAndMissingShardsAndCommitRecords) {
  const FolderCheck check = verify_folder(out_);
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_EQ(check.shards(), 2);
  EXPECT_EQ(check.samples, 6);
  EXPECT_EQ(check.valid, 6);
  const std::string text = testing::read_file(record_), bytes = testing::read_file(shard_);
  testing::write_file(record_, text.substr(0, text.size() / 2));
  EXPECT_THAT(faults(), texts_with({record_.string()}));
  testing::write_file(record_, testing::read_file(out_ / "job-train-00000-of-00002.json"));
  EXPECT_THAT(faults(), texts_with({{record_.string(), "got one of job-train-00000-of-00002.h5"}}));
  std::filesystem::remove(record_);
  EXPECT_THAT(faults(), texts_with({"not committed"}));
  testing::write_file(record_, text);
  std::string damaged = bytes;
  damaged[bytes.size() / 2] ^= 1;
  testing::write_file(shard_, damaged);
  EXPECT_THAT(faults(), ::testing::Contains(HasSubstr(shard_.string())));
  for (const std::uintmax_t size : {1000, 0}) {
    std::filesystem::resize_file(shard_, size);
    EXPECT_THAT(faults(), texts_with({{shard_.string(), "got " + std::to_string(size)}}));
  }
  std::filesystem::remove(shard_);
  EXPECT_THAT(faults(), texts_with({{shard_.string(), "got no file"}}));
  std::filesystem::remove(record_);
  EXPECT_THAT(faults(), texts_with({{record_.string(), "not made yet"}}));
}

TEST_F(VerifyFolder, NamesAPlanThatIsNotTheCommitRecords) {
  std::string plan = testing::read_file(out_ / "plan.json");
  plan.replace(plan.find("f_10.png"), 8, "f_11.png");
  testing::write_file(out_ / "plan.json", plan);
  EXPECT_THAT(faults(), texts_with({{(out_ / "plan.json").string(), "that all commit records name"},
                                    "00000-of-00002.json",
                                    record_.string()}));
  // One commit record alone may be what is altered.
  std::filesystem::remove(shard_);
  std::filesystem::remove(record_);
  EXPECT_THAT(faults(), texts_with({"00000-of-00002.json", record_.string()}));
  testing::write_file(out_ / "plan.json", plan.substr(0, plan.size() / 2));
  EXPECT_THROWS(faults(), std::runtime_error, (out_ / "plan.json").string());
}

TEST_F(VerifyFolder, NamesWhatLiesBesideTheShardsAndNotesTemporaries) {
  const auto temporary = temporary_beside(shard_);
  testing::write_file(temporary, "");
  finalize(out_, {});
  const FolderCheck check = verify_folder(out_);
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_THAT(check.notes, texts_with({temporary.string()}));
  testing::write_file(out_ / "dataset.json", "{}");
  EXPECT_THAT(faults(), texts_with({(out_ / "dataset.json").string()}));
  std::filesystem::remove(out_ / "dataset.json");
  std::filesystem::remove(out_ / "dataset.h5");
  testing::write_file(out_ / "amendments.json", "{");
  EXPECT_THAT(faults(), texts_with({(out_ / "amendments.json").string()}));
  std::filesystem::remove(out_ / "amendments.json");
  testing::write_file(out_ / "old.h5", "");
  EXPECT_THAT(faults(), texts_with({"old.h5"}));
  std::filesystem::remove(out_ / "plan.json");
  EXPECT_THROWS(faults(), InputError, "expected a folder that eventgan convert has written");
}

TEST_F(VerifyFolder, DeepComparesWithTheSourcesWhereTheyAreThere) {
  const VerifyOptions deep{.deep = true, .manifest = {}};
  FolderCheck check = verify_folder(out_, deep);
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_THAT(check.notes, ElementsAre());
  EXPECT_EQ(check.compared, 6);
  EXPECT_EQ(verify_folder(out_).compared, 0);

  testing::write_flat_image(folder_ / "clip/f_16.png", {20, 40}, 0);
  EXPECT_THAT(verify_folder(out_, deep).faults, texts_with({{shard_.string(), "got 30x20"}}));

  std::filesystem::rename(folder_ / "clip", folder_ / "elsewhere");
  check = verify_folder(out_, deep);
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_THAT(check.notes, texts_with({"not compared"}));
  EXPECT_EQ(check.compared, 0);

  std::filesystem::remove(out_ / "run.json");
  EXPECT_THAT(verify_folder(out_, deep).notes, texts_with({"labels not compared"}));
}

TEST_F(VerifyFolder, DeepFindsSourcesThatHaveMoved) {
  std::filesystem::create_directory(folder_ / "moved");
  std::filesystem::rename(folder_ / "clip", folder_ / "moved/clip");
  testing::write_file(folder_ / "moved/job.json", read_frozen_outline(out_).plan.manifest_text);
  const FolderCheck check =
      verify_folder(out_, {.deep = true, .manifest = folder_ / "moved/job.json"});
  EXPECT_THAT(check.faults, ElementsAre());
  EXPECT_EQ(check.compared, 6);
}

}  // namespace
}  // namespace eventgan

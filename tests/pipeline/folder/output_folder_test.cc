#include "pipeline/folder/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <system_error>
#include <thread>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/format_version.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/shard.h"
#include "pipeline/folder/amendments.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::names_in;
using ::testing::Not;
using testing::read_file;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_file;

constexpr char kText[] = R"({
  "format": "eventgan-manifest", "version": 1, "name": "job",
  "sources": [{ "dataset": "frames", "root": "clip",
                "pairs": { "gaps": [1], "side": "before", "choose": "one" } }],
  "image": { "preset": "mpii" }, "output": { "directory": "out" } })";

PlanOutline plan() {
  PlanOutline outline;
  outline.manifest_text = kText;
  return outline;
}

TEST(RecordedManifest, HasTheFrozenTextAndTheRecordedFolderOrSaysWhatToDo) {
  const testing::TemporaryFolder folder;
  EXPECT_THROWS(recorded_manifest(folder.path(), plan(), std::nullopt), UsageError, "run.json",
                "--manifest FILE");
  record_manifest_folder(folder.path(), parse_job_manifest(kText, "/data/jobs", "manifest.json"));
  const JobManifest manifest = recorded_manifest(folder.path(), plan(), std::nullopt);
  EXPECT_EQ(manifest.text, kText);
  EXPECT_EQ(manifest.directory, "/data/jobs");
}

TEST(RecordedManifest, IsTheGivenFileWhereTheInputsHaveMoved) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "moved" / "job.json", std::string("// moved\n") + kText);
  const JobManifest manifest = recorded_manifest(folder.path(), plan(), folder / "moved/job.json");
  EXPECT_THAT(manifest.text, ::testing::StartsWith("// moved"));
  EXPECT_EQ(manifest.directory, folder / "moved");
  EXPECT_THROWS(recorded_manifest(folder.path(), plan(), folder / "absent.json"), InputError,
                "expected a manifest, got \"No such file or directory\"");
}

constexpr char kShard[] = "job-train-00000-of-00001.h5";

Plan plan(const std::string& weights, const std::string& frames = "f") {
  Plan result;
  result.name = "job";
  result.manifest_text = "{}";
  result.fingerprint = {{"weights", weights}, {"frames", frames}};
  result.sources.resize(1);
  result.shards = {{kShard, 0, {2, 2}, {{"a", "", "", {{"p"}, {"n"}, 1, 0, 1}, ""}}}};
  return result;
}

TEST(FreezePlan, WritesTheTextWhoseHashItGivesAndALaterRunTakesIt) {
  const TemporaryFolder folder;
  const FrozenPlan frozen = freeze_plan(folder.path(), plan("w"));
  EXPECT_EQ(read_file(folder / "plan.json"), to_json(plan("w")));
  EXPECT_EQ(frozen.hash, sha256_hex(to_json(plan("w"))));
  EXPECT_EQ(to_json(frozen.plan), to_json(plan("w")));
  EXPECT_THAT(names_in(folder.path()), ElementsAre("plan.json"));
  const FrozenPlan first = freeze_plan(folder.path(), plan("w"));
  const FrozenPlan second = freeze_plan(folder.path(), plan("w"));
  EXPECT_EQ(first.hash, second.hash);
  EXPECT_EQ(read_frozen_plan(folder.path()).hash, first.hash);
  EXPECT_EQ(read_frozen_outline(folder.path()).hash, first.hash);
}

TEST(FreezePlan, OfManyWorkersThatRaceAllTakeTheSame) {
  const TemporaryFolder folder;
  std::vector<std::string> hashes(8);
  std::vector<std::jthread> workers;
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    workers.emplace_back([&, i] {
      Plan mine = plan("w");
      mine.manifest_text = "{ /* " + std::to_string(i) + " */ }";
      hashes[i] = freeze_plan(folder.path(), std::move(mine)).hash;
    });
  }
  workers.clear();
  EXPECT_THAT(hashes, ::testing::Each(sha256_of_file(folder / "plan.json")));
  EXPECT_THAT(names_in(folder.path()), ElementsAre("plan.json"));
}

TEST(FreezePlan, TakesTheFrozenManifestWhereOnlyItsTextDiffers) {
  const TemporaryFolder folder;
  const FrozenPlan first = freeze_plan(folder.path(), plan("w"));
  Plan other = plan("w");
  other.manifest_text = "{ /* a remark */ }";
  const FrozenPlan second = freeze_plan(folder.path(), std::move(other));
  EXPECT_EQ(second.hash, first.hash);
  EXPECT_EQ(second.plan.manifest_text, "{}");
}

TEST(FreezePlan, RefusesAnotherFingerprintFieldByField) {
  const TemporaryFolder folder;
  freeze_plan(folder.path(), plan("w"));
  EXPECT_THROWS(freeze_plan(folder.path(), plan("v")), UsageError,
                AllOf(HasSubstr("weights: expected w, got v"), Not(HasSubstr("frames"))));
}

TEST(FreezePlan, SendsToRetryWhereOnlyInputsDiffer) {
  const TemporaryFolder folder;
  freeze_plan(folder.path(), plan("w", "holed"));
  EXPECT_THROWS(freeze_plan(folder.path(), plan("w", "whole")), UsageError, "eventgan retry",
                "frames: expected holed, got whole");
  EXPECT_THROWS(freeze_plan(folder.path(), plan("v", "whole")), UsageError,
                Not(HasSubstr("eventgan retry")));
}

TEST(FreezePlan, RefusesAnAlteredPlan) {
  const TemporaryFolder folder;
  Plan altered = plan("w");
  altered.shards[0].samples[0].pair.gap_frames = 2;
  freeze_plan(folder.path(), altered);
  EXPECT_THROWS(freeze_plan(folder.path(), plan("w")), UsageError,
                "got an altered one, in " + (folder / "plan.json").string());
}

TEST(FreezePlan, WhatWasNoteworthyBesideTheInputsMayChange) {
  const TemporaryFolder folder;
  Plan first = plan("w");
  first.sources.resize(1);
  Plan later = first;
  first.sources[0].notes = {"a file that belongs to nothing"};
  const FrozenPlan frozen = freeze_plan(folder.path(), first);
  const FrozenPlan taken = freeze_plan(folder.path(), later);
  EXPECT_EQ(taken.hash, frozen.hash);
  EXPECT_EQ(taken.plan.sources[0].notes, first.sources[0].notes);
}

TEST(FreezePlan, SaysThatTheFrozenOneIsDamagedAndLeavesIt) {
  const TemporaryFolder folder;
  const std::string half = to_json(plan("w")).substr(0, 200);
  write_file(folder / "plan.json", half);
  EXPECT_THROWS(freeze_plan(folder.path(), plan("w")), std::runtime_error,
                "got a damaged one, in " + (folder / "plan.json").string());
  EXPECT_EQ(read_file(folder / "plan.json"), half);
}

TEST(FreezePlan, LeavesNothingOnAFullDisk) {
  const TemporaryFolder folder;
  Plan large = plan("w");
  large.shards[0].samples.assign(1000, large.shards[0].samples[0]);
  const std::string error =
      testing::error_on_full_disk(5000, [&] { freeze_plan(folder.path(), large); });
  EXPECT_THAT(error, HasSubstr((folder / ".plan.json.").string()));
  EXPECT_THAT(names_in(folder.path()), ElementsAre());
}

TEST(FreezePlan, AfterARetryTheMendedInputsAreTheRightOnes) {
  const TemporaryFolder folder;
  Plan holed = plan("w", "with a missing frame");
  holed.shards[0].samples[0].fault = "expected a frame, got no file, in p";
  const std::string hash = freeze_plan(folder.path(), holed).hash;
  EXPECT_THROWS(freeze_plan(folder.path(), plan("w", "whole")), UsageError,
                "plan.json was frozen by a run");

  record_amendment(folder.path(), hash, {{{"frames", "whole"}}, {"a"}});
  const FrozenPlan frozen = freeze_plan(folder.path(), plan("w", "whole"));
  EXPECT_EQ(frozen.hash, hash);
  EXPECT_EQ(to_json(frozen.plan), to_json(holed)) << "the samples stay as they were frozen";
  EXPECT_THROWS(freeze_plan(folder.path(), plan("v", "whole")), UsageError,
                "plan.json was frozen by a run");
  // The inputs as they were would make other bytes than the retry has.
  EXPECT_THROWS(freeze_plan(folder.path(), holed), UsageError,
                "frames: expected whole, got with a missing frame");
}

TEST(ReadFrozenPlan, SaysWhenThereIsNoneOrADamagedOne) {
  const TemporaryFolder folder;
  EXPECT_THROWS(read_frozen_plan(folder.path()), InputError,
                "expected a folder that eventgan convert has written, got no");
  EXPECT_THROWS(read_frozen_outline(folder.path()), InputError,
                "expected a folder that eventgan convert has written, got no");
  fs::create_directory(folder / "plan.json");
  const auto says_why = ThrowsMessage<std::runtime_error>(
      AllOf(HasSubstr("cannot read"), HasSubstr("Is a directory"), Not(HasSubstr("--overwrite"))));
  EXPECT_THAT([&] { read_frozen_plan(folder.path()); }, says_why);
  EXPECT_THAT([&] { read_frozen_outline(folder.path()); }, says_why);
  fs::remove(folder / "plan.json");
  fs::create_symlink("/proc/self/mem", folder / "plan.json");  // whose first byte cannot be read
  const auto fails = ThrowsMessage<std::runtime_error>(
      AllOf(HasSubstr("'Input/output error', in"), HasSubstr("plan.json"), Not(HasSubstr("--"))));
  EXPECT_THAT([&] { read_frozen_plan(folder.path()); }, fails);
  EXPECT_THAT([&] { read_frozen_outline(folder.path()); }, fails);
  fs::remove(folder / "plan.json");
  write_file(folder / "plan.json", "{");
  EXPECT_THROWS(read_frozen_plan(folder.path()), std::runtime_error,
                "expected a whole plan, got a damaged one");
  EXPECT_THROWS(read_frozen_outline(folder.path()), std::runtime_error,
                "expected a whole plan, got a damaged one");
}

TEST(ReadFrozenPlan, GivesTheHashOfWhatItRead) {
  const std::size_t rest = to_json(plan("w")).size();
  // Less than a block of reading; a block; several and a part of one.
  for (const std::size_t size : {1000, 1 << 20, (3 << 20) + 1}) {
    const TemporaryFolder folder;
    Plan long_one = plan("w");
    long_one.manifest_text += std::string(size - rest, ' ');
    freeze_plan(folder.path(), long_one);
    ASSERT_EQ(fs::file_size(folder / "plan.json"), size);
    const FrozenPlan frozen = read_frozen_plan(folder.path());
    EXPECT_EQ(frozen.hash, sha256_of_file(folder / "plan.json"));
    EXPECT_EQ(frozen.plan.manifest_text, long_one.manifest_text);
    EXPECT_EQ(read_frozen_outline(folder.path()).hash, frozen.hash);
  }
}

TEST(ReadFrozenOutline, IsThePlanWithoutItsSamples) {
  const TemporaryFolder folder;
  freeze_plan(folder.path(), plan("w"));
  const FrozenOutline frozen = read_frozen_outline(folder.path());
  EXPECT_EQ(frozen.plan.fingerprint, plan("w").fingerprint);
  EXPECT_THAT(frozen.plan.shards, ElementsAre(outline_of(plan("w").shards[0])));
}

TEST(DiscardOutput, RemovesWhatThePlanNamesAndNothingElse) {
  const TemporaryFolder folder;
  const auto discard = [&] { discard_output(folder.path(), plan("v").fingerprint, "/jobs"); };
  discard();  // nothing there
  freeze_plan(folder.path(), plan("w"));
  for (const char* name : {kShard, "job-train-00000-of-00001.json", "mine.h5", "dataset.json",
                           "dataset.h5", "amendments.json"}) {
    write_file(folder / name, "x");
  }
  discard();
  EXPECT_THAT(names_in(folder.path()), ElementsAre("mine.h5"));
}

TEST(DiscardOutput, BelievesNoNameThatAPlanDoesNotGive) {
  const TemporaryFolder folder;
  for (const std::string name : {"mine.h5", "../job-train-00000-of-00001.h5", "out/mine.h5",
                                 "mine.h5\\u0000-train-00000-of-00001.h5"}) {
    for (const char* file : {"mine.h5", "mine.json", kShard, "out/mine.h5"}) {
      write_file(folder / "job" / file, "mine");
    }
    for (const char* file : {kShard, "job-train-00000-of-00001.json"}) {
      write_file(folder / file, "mine");
    }
    const std::string text = to_json(plan("w"));
    const std::size_t at = text.find(kShard);
    write_file(folder / "job/plan.json", std::string(text).replace(at, sizeof kShard - 1, name));
    EXPECT_THROWS(read_frozen_outline(folder / "job"), std::runtime_error, "plan.json");
    discard_output(folder / "job", plan("w").fingerprint, "/jobs");
    EXPECT_THAT(names_in(folder / "job"), ElementsAre(kShard, "mine.h5", "mine.json", "out"));
    EXPECT_TRUE(fs::exists(folder / "job/out/mine.h5"));
    EXPECT_THAT(names_in(folder.path()),
                ElementsAre("job", kShard, "job-train-00000-of-00001.json"));
  }
}

TEST(DiscardOutput, OfADamagedPlanLeavesTheShardsItCannotName) {
  const TemporaryFolder folder;
  for (const char* name : {"plan.json", kShard, "dataset.json"}) write_file(folder / name, "x");
  discard_output(folder.path(), plan("w").fingerprint, "/jobs");
  EXPECT_THAT(names_in(folder.path()), ElementsAre(kShard));
}

TEST(DiscardOutput, OfADamagedPlanRemovesTheShardsThatAreItsOwn) {
  const TemporaryFolder folder;
  CommitRecord record;
  record.shard = "job-val-00003-of-00007.h5";
  record.plan_hash = record.sha256 = std::string(64, 'a');
  write_file(folder / "job-val-00003-of-00007.json", to_json(record));
  for (const char* name : {"plan.json", "job-val-00003-of-00007.h5", "mine.h5",
                           "mine-train-00000-of-00001.h5", "mine-train-00000-of-00001.json"}) {
    write_file(folder / name, "x");
  }
  discard_output(folder.path(), plan("w").fingerprint, "/jobs");
  EXPECT_THAT(names_in(folder.path()), ElementsAre("mine-train-00000-of-00001.h5",
                                                   "mine-train-00000-of-00001.json", "mine.h5"));
}

TEST(DiscardOutput, OfAPlanThatALaterProgramWroteIsRefused) {
  const TemporaryFolder folder;
  std::string text = to_json(plan("w"));
  const std::string version = "\"version\":\"1.";
  const std::size_t at = text.find(version);
  ASSERT_NE(at, text.npos) << text.substr(0, 80);
  write_file(folder / "plan.json", text.replace(at, version.size(), "\"version\":\"2."));
  write_file(folder / kShard, "x");
  EXPECT_THROWS(discard_output(folder.path(), plan("w").fingerprint, "/jobs"), UnreadableVersion,
                "plan.json");
  EXPECT_THAT(names_in(folder.path()), ElementsAre(kShard, "plan.json"));
}

TEST(OutdateDataset, RemovesWhatNamesTheShardOrIsDamagedAndNothingOfAPerson) {
  const TemporaryFolder folder;
  const auto removes = [&](const std::string& text) {
    for (const char* name : {"dataset.h5", kShard}) write_file(folder / name, "x");
    write_file(folder / "dataset.json", text);
    const bool removed = outdate_dataset(folder.path(), kShard);
    EXPECT_EQ(fs::exists(folder / "dataset.json"), !removed) << text;
    EXPECT_EQ(fs::exists(folder / "dataset.h5"), !removed) << text;
    EXPECT_TRUE(fs::exists(folder / kShard));
    return removed;
  };
  const std::string shard = kShard;
  const std::string own = R"({"format": "eventgan-dataset", )";
  EXPECT_TRUE(removes(own + R"("shards": [{"name": "a.h5"}, {"name": ")" + shard + R"("}]})"));
  EXPECT_FALSE(removes(own + R"("shards": [{"name": "a.h5"}], "missing": [")" + shard + R"("]})"));
  EXPECT_FALSE(removes(own + R"("shards": []})"));
  EXPECT_TRUE(removes(""));
  for (const char* damaged :
       {"", R"("a": 1})", R"("shards": 3})", R"("shards": [3]})", R"("shards": [{"size": 3}]})"}) {
    EXPECT_TRUE(removes(own + damaged)) << damaged;
  }
  for (const char* foreign : {"{", "[]", "{}", R"({"shards": 3})", R"({"images": []})"}) {
    EXPECT_FALSE(removes(foreign)) << foreign;
  }
  const std::string with_hash = own + R"("shards": [{"name": ")" + shard + R"(", "sha256": "a"}]})";
  write_file(folder / "dataset.json", with_hash);
  EXPECT_FALSE(outdate_dataset(folder.path(), kShard, "a"));  // it tells of the shard as it is
  EXPECT_TRUE(outdate_dataset(folder.path(), kShard, "b"));
  EXPECT_FALSE(outdate_dataset(folder.path(), kShard));  // there is none
}

/// A folder with the shard of a job over the clip FOLDER/a/clip, and the plans of others.
class DiscardOutputOfAnotherJob : public ::testing::Test {
 protected:
  DiscardOutputOfAnotherJob() {
    fs::create_directories(out_);
    fs::create_directories(folder_ / "a/clip");
    fs::create_directories(folder_ / "b/clip");
    mine_.fingerprint["manifest $.name"] = R"("job")";
    mine_.fingerprint["manifest $.seed"] = "7";
    mine_.fingerprint["frames"] = "theirs";
    mine_.fingerprint["manifest $.sources[0].dataset"] = R"("frames")";
    mine_.fingerprint["manifest $.sources[0].root"] = R"("clip")";
    mine_.fingerprint["manifest $.sources[0].pairs.gaps[0]"] = "1";
    freeze_plan(out_, mine_);
    JobManifest manifest;
    manifest.directory = folder_ / "a";
    record_manifest_folder(out_, manifest);
    write_file(out_ / kShard, "x");
  }

  Plan with(const std::string& field, const std::string& value) const {
    Plan other = mine_;
    other.fingerprint[field] = value;
    return other;
  }

  /// What both ways to the folder say, after which all is as it was.
  void expect_refused(const Plan& other, const std::string& where, const std::string& text) const {
    const auto before = names_in(out_);
    const fs::path manifest_folder = folder_ / where;
    const auto refused = ThrowsMessage<UsageError>(
        AllOf(HasSubstr("got that of another job, \"job\", in " + out_.string()),
              HasSubstr("choose another output folder, or remove that one yourself"),
              HasSubstr(text), Not(HasSubstr("--overwrite"))));
    EXPECT_THAT([&] { discard_output(out_, other.fingerprint, manifest_folder); }, refused);
    if (other.fingerprint != mine_.fingerprint) {
      EXPECT_THAT([&] { freeze_plan(out_, other, {}, manifest_folder); }, refused);
    }
    EXPECT_EQ(names_in(out_), before);
  }

  void expect_discarded(const Plan& other, const fs::path& manifest_folder) {
    discard_output(out_, other.fingerprint, manifest_folder);
    EXPECT_THAT(names_in(out_), ElementsAre("run.json"));
  }

  TemporaryFolder folder_;
  const fs::path out_ = folder_ / "out";
  Plan mine_ = plan("w");
};

TEST_F(DiscardOutputOfAnotherJob, IsRefused) {
  expect_refused(with("manifest $.name", R"("other")"), "a", R"(.name: expected "job", got "oth)");
  expect_refused(with("manifest $.sources[0].root", R"("../b/clip")"), "a", "sources[0].root: ");
  expect_refused(with("manifest $.sources[0].split", R"("val")"), "a", "sources[0].split: ");
  expect_refused(with("manifest $.sources[1].root", R"("clip")"), "a", "sources[1].root: ");
  expect_refused(with("limit", "20"), "a", "limit: expected nothing, got 20");
}

TEST_F(DiscardOutputOfAnotherJob, IsToldByWhereItsFramesLie) {
  expect_refused(
      mine_, "b",
      "root: expected " + (folder_ / "a/clip").string() + ", got " + (folder_ / "b/clip").string());
  expect_discarded(with("manifest $.sources[0].root", R"("../a/./clip")"), folder_ / "b");
}

TEST_F(DiscardOutputOfAnotherJob, IsTheSameWhereItsFramesWereMoved) {
  fs::remove_all(folder_ / "b");
  fs::rename(folder_ / "a", folder_ / "b");
  EXPECT_THROWS(
      discard_output(out_, with("frames", "others").fingerprint, folder_ / "b"), UsageError,
      "expected the output folder of this job, got that of another");  // a job of another folder,
                                                                       // whose own is not mounted
  expect_discarded(mine_, folder_ / "b");
}

TEST_F(DiscardOutputOfAnotherJob, IsToldByItsFramesWhereNothingSaysWhereTheyLie) {
  fs::remove(out_ / "run.json");
  EXPECT_THROWS(discard_output(out_, with("frames", "others").fingerprint, folder_ / "a"),
                UsageError, "expected the output folder of this job, got that of another");
  EXPECT_NO_THROW(discard_output(out_, mine_.fingerprint, folder_ / "a"));
}

TEST_F(DiscardOutputOfAnotherJob, IsTheSameWithOtherSettings) {
  Plan other = with("manifest $.seed", "8");
  other.fingerprint["manifest $.sources[0].pairs.gaps[0]"] = "2";
  other.fingerprint["weights"] = "v";
  EXPECT_THROWS(freeze_plan(out_, other, {}, folder_ / "a"), UsageError,
                "--overwrite starts again");
  expect_discarded(other, folder_ / "a");
}

TEST_F(DiscardOutputOfAnotherJob, IsToldByADamagedPlanToo) {
  std::string text = read_file(out_ / "plan.json");
  write_file(out_ / "plan.json", text.substr(0, text.size() / 2));
  Plan other = with("manifest $.name", R"("other")");
  EXPECT_THROWS(discard_output(out_, other.fingerprint, folder_ / "a"), UsageError,
                "expected the output folder of this job, got that of another");
  EXPECT_NO_THROW(discard_output(out_, mine_.fingerprint, folder_ / "a"));
}

TEST(RecordedManifestFolder, IsWhatWasRecorded) {
  const TemporaryFolder folder;
  EXPECT_FALSE(recorded_manifest_folder(folder.path()));
  JobManifest manifest;
  manifest.directory = "/data/here";
  record_manifest_folder(folder.path(), manifest);
  EXPECT_EQ(recorded_manifest_folder(folder.path()), "/data/here");
  write_file(folder / "run.json", "[1, 2");
  EXPECT_FALSE(recorded_manifest_folder(folder.path()));
}

TEST(RecordedManifestFolder, IsAnAbsolutePathOrNone) {
  const TemporaryFolder folder;
  for (const char* path : {R"("")", R"("here")", R"("../here")", R"("http://here")",
                           R"("/a\u0000b")", "7", R"(["/a"])"}) {
    write_file(folder / "run.json", R"({"manifest_folder": )" + std::string(path) + "}");
    EXPECT_FALSE(recorded_manifest_folder(folder.path())) << path;
  }
  write_file(folder / "run.json", R"({"manifest_folder_bytes": [97, 255]})");
  EXPECT_FALSE(recorded_manifest_folder(folder.path()));
  write_file(folder / "run.json", R"({"manifest_folder_bytes": [47, 255]})");
  EXPECT_EQ(recorded_manifest_folder(folder.path()), "/\xff");
}

}  // namespace
}  // namespace eventgan

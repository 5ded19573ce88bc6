#include "pipeline/folder/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <system_error>
#include <thread>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/shard.h"
#include "pipeline/folder/amendments.h"
#include "stages/base/files/sha256.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

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

TEST(RecordedManifest, HasTheFrozenTextAndTheRecordedFolder) {
  const testing::TemporaryFolder folder;
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
  EXPECT_THROW(recorded_manifest(folder.path(), plan(), folder / "absent.json"), InputError);
}

TEST(RecordedManifest, SaysWhatToDoIfNothingIsRecorded) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT([&] { recorded_manifest(folder.path(), plan(), std::nullopt); },
              ::testing::ThrowsMessage<UsageError>(::testing::AllOf(
                  ::testing::HasSubstr("run.json"), ::testing::HasSubstr("--manifest FILE"))));
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

TEST(FreezePlan, WritesTheTextWhoseHashItGives) {
  const TemporaryFolder folder;
  const FrozenPlan frozen = freeze_plan(folder.path(), plan("w"));
  EXPECT_EQ(read_file(folder / "plan.json"), to_json(plan("w")));
  EXPECT_EQ(frozen.hash, sha256_hex(to_json(plan("w"))));
  EXPECT_EQ(to_json(frozen.plan), to_json(plan("w")));
  EXPECT_THAT(names_in(folder.path()), ElementsAre("plan.json"));
}

TEST(FreezePlan, TheFirstWinsAndALaterRunTakesIt) {
  const TemporaryFolder folder;
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
  EXPECT_THAT([&] { freeze_plan(folder.path(), plan("v")); },
              ThrowsMessage<UsageError>(
                  AllOf(HasSubstr("weights: expected w, got v"), Not(HasSubstr("frames")))));
}

TEST(FreezePlan, SendsToRetryWhereOnlyInputsDiffer) {
  const TemporaryFolder folder;
  freeze_plan(folder.path(), plan("w", "holed"));
  EXPECT_THAT([&] { freeze_plan(folder.path(), plan("w", "whole")); },
              ThrowsMessage<UsageError>(AllOf(HasSubstr("eventgan retry"),
                                              HasSubstr("frames: expected holed, got whole"))));
  EXPECT_THAT([&] { freeze_plan(folder.path(), plan("v", "whole")); },
              ThrowsMessage<UsageError>(Not(HasSubstr("eventgan retry"))));
}

TEST(FreezePlan, RefusesAnAlteredPlan) {
  const TemporaryFolder folder;
  Plan altered = plan("w");
  altered.shards[0].samples[0].pair.gap_frames = 2;
  freeze_plan(folder.path(), altered);
  EXPECT_THAT([&] { freeze_plan(folder.path(), plan("w")); },
              ThrowsMessage<UsageError>(
                  HasSubstr("got an altered one, in " + (folder / "plan.json").string())));
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
  EXPECT_THAT([&] { freeze_plan(folder.path(), plan("w")); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("got a damaged one, in " + (folder / "plan.json").string())));
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
  Plan holed = plan("w", "with a hole");
  holed.shards[0].samples[0].fault = "expected a frame, got no file, in p";
  const std::string hash = freeze_plan(folder.path(), holed).hash;
  EXPECT_THROW(freeze_plan(folder.path(), plan("w", "whole")), UsageError);

  record_amendment(folder.path(), hash, {{{"frames", "whole"}}, {"a"}});
  const FrozenPlan frozen = freeze_plan(folder.path(), plan("w", "whole"));
  EXPECT_EQ(frozen.hash, hash);
  EXPECT_EQ(to_json(frozen.plan), to_json(holed)) << "the samples stay as they were frozen";
  EXPECT_THROW(freeze_plan(folder.path(), plan("v", "whole")), UsageError);
  // The inputs as they were would make other bytes than the retry has.
  EXPECT_THAT([&] { freeze_plan(folder.path(), holed); },
              ThrowsMessage<UsageError>(HasSubstr("frames: expected whole, got with a hole")));
}

TEST(ReadFrozenPlan, SaysWhenThereIsNoneOrADamagedOne) {
  const TemporaryFolder folder;
  EXPECT_THROW(read_frozen_plan(folder.path()), InputError);
  EXPECT_THROW(read_frozen_outline(folder.path()), InputError);
  fs::create_directory(folder / "plan.json");
  EXPECT_THAT([&] { read_frozen_plan(folder.path()); },
              ThrowsMessage<std::system_error>(
                  AllOf(HasSubstr("cannot read"), Not(HasSubstr("--overwrite")))));
  EXPECT_THROW(read_frozen_outline(folder.path()), std::system_error);
  fs::remove(folder / "plan.json");
  write_file(folder / "plan.json", "{");
  EXPECT_THROW(read_frozen_plan(folder.path()), std::runtime_error);
  EXPECT_THROW(read_frozen_outline(folder.path()), std::runtime_error);
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
  discard_output(folder.path());  // nothing there
  freeze_plan(folder.path(), plan("w"));
  for (const char* name : {kShard, "job-train-00000-of-00001.json", "mine.h5", "dataset.json",
                           "dataset.h5", "amendments.json"}) {
    write_file(folder / name, "x");
  }
  discard_output(folder.path());
  EXPECT_THAT(names_in(folder.path()), ElementsAre("mine.h5"));
}

TEST(DiscardOutput, OfADamagedPlanLeavesTheShardsItCannotName) {
  const TemporaryFolder folder;
  for (const char* name : {"plan.json", kShard, "dataset.json"}) write_file(folder / name, "x");
  discard_output(folder.path());
  EXPECT_THAT(names_in(folder.path()), ElementsAre(kShard));
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

}  // namespace
}  // namespace eventgan

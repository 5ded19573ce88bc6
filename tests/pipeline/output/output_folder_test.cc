#include "pipeline/output/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

Plan plan(const std::string& weights) {
  Plan result;
  result.name = "job";
  result.fingerprint = {{"weights", weights}};
  result.sources.resize(1);
  result.shards = {
      {"job-train-00000-of-00001.h5", 0, {2, 2}, {{"a", "", "", {{"p"}, {"n"}, 1, 0, 1}, ""}}}};
  return result;
}

const std::string kHash(64, 'a');

ShardMarker marker(const std::string& plan_hash, std::int64_t size) {
  return {"job-train-00000-of-00001.h5", plan_hash, kHash, size, 1, 1, {}, {}};
}

TEST(FreezePlan, TheFirstWinsAndALaterRunTakesIt) {
  const testing::TemporaryFolder folder;
  const FrozenPlan first = freeze_plan(folder.path(), plan("w"));
  const FrozenPlan second = freeze_plan(folder.path(), plan("w"));
  EXPECT_EQ(first.hash, second.hash);
  EXPECT_EQ(read_frozen_plan(folder.path()).hash, first.hash);
}

TEST(FreezePlan, RefusesAnotherFingerprintFieldByField) {
  const testing::TemporaryFolder folder;
  freeze_plan(folder.path(), plan("w"));
  EXPECT_THAT(
      [&] { freeze_plan(folder.path(), plan("v")); },
      ::testing::ThrowsMessage<UsageError>(::testing::HasSubstr("weights: expected w, got v")));
}

TEST(ReadFrozenPlan, SaysWhenThereIsNoneOrADamagedOne) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(read_frozen_plan(folder.path()), InputError);
  testing::write_file(folder / "plan.json", "{");
  EXPECT_THROW(read_frozen_plan(folder.path()), std::runtime_error);
}

TEST(DoneMarker, NeedsMarkerPlanAndSizeToAgree) {
  const testing::TemporaryFolder folder;
  const PlannedShard shard = plan("w").shards[0];
  const auto marker_file = folder / "job-train-00000-of-00001.json";
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash));
  testing::write_file(folder / shard.name, "12345");
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash)) << "a shard without marker";
  testing::write_file(marker_file, to_json(marker(kHash, 5)));
  EXPECT_TRUE(done_marker(folder.path(), shard, kHash));
  testing::write_file(marker_file, to_json(marker(kHash, 6)));
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash)) << "another size";
  testing::write_file(marker_file, to_json(marker(std::string(64, 'b'), 5)));
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash)) << "another plan";
  testing::write_file(marker_file, to_json(marker(kHash, 5)).substr(0, 40));
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash)) << "a torn marker";
  testing::write_file(marker_file, to_json(marker(kHash, 5)));
  std::filesystem::remove(folder / shard.name);
  EXPECT_FALSE(done_marker(folder.path(), shard, kHash)) << "a marker without shard";
}

TEST(DiscardOutput, RemovesWhatThePlanNamesAndNothingElse) {
  const testing::TemporaryFolder folder;
  discard_output(folder.path());  // nothing there
  freeze_plan(folder.path(), plan("w"));
  for (const char* name :
       {"job-train-00000-of-00001.h5", "job-train-00000-of-00001.json", "mine.h5"}) {
    testing::write_file(folder / name, "x");
  }
  discard_output(folder.path());
  EXPECT_FALSE(std::filesystem::exists(folder / "plan.json"));
  EXPECT_FALSE(std::filesystem::exists(folder / "job-train-00000-of-00001.h5"));
  EXPECT_FALSE(std::filesystem::exists(folder / "job-train-00000-of-00001.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "mine.h5"));
}

TEST(RecordedManifestFolder, IsWhatWasRecorded) {
  const testing::TemporaryFolder folder;
  EXPECT_FALSE(recorded_manifest_folder(folder.path()));
  JobManifest manifest;
  manifest.directory = "/data/here";
  record_manifest_folder(folder.path(), manifest);
  EXPECT_EQ(recorded_manifest_folder(folder.path()), "/data/here");
  testing::write_file(folder / "run.json", "[1, 2");
  EXPECT_FALSE(recorded_manifest_folder(folder.path()));
}

}  // namespace
}  // namespace eventgan

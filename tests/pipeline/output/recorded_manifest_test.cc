#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "pipeline/folder/output_folder.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

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

}  // namespace
}  // namespace eventgan

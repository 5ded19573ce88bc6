#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"
#include "tests/manifests/manifest_cases.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(ManifestFile, IsReadWithItsTextAndFolder) {
  const testing::TemporaryFolder folder;
  const std::string text = std::string("// a comment\r\n") + testing::kSoundManifest;
  testing::write_file(folder / "m.json", text);
  const JobManifest manifest = read_job_manifest(folder / "m.json");
  EXPECT_EQ(manifest.text, text);
  EXPECT_EQ(manifest.directory, folder.path());
}

TEST(ManifestFile, ThatCannotBeReadIsMissingInput) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(
      [&] { read_job_manifest(folder / "none.json"); },
      ThrowsMessage<InputError>("expected a manifest, got \"No such file or directory\", in " +
                                (folder / "none.json").string()));
  EXPECT_THAT([&] { read_job_manifest(folder.path()); },
              ThrowsMessage<InputError>(HasSubstr("got \"a folder\"")));
}

TEST(ManifestFile, FaultsNameTheFile) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "m.json";
  testing::write_file(file, "");
  EXPECT_THAT([&] { read_job_manifest(file); },
              ThrowsMessage<UsageError>(HasSubstr(file.string() + ":1:1: expected JSON")));
  testing::write_file(file, "{}");
  EXPECT_THAT([&] { read_job_manifest(file); },
              ThrowsMessage<UsageError>(HasSubstr(file.string() + ": $.format: expected")));
}

}  // namespace
}  // namespace eventgan

#include "pipeline/exports/export_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(ExportFolder, TakesNamesForTheSameIfTheyDifferInCaseAlone) {
  const testing::TemporaryFolder folder;
  ExportFolder out(folder / "out", "job a\n", /*overwrite=*/false);
  ExportFolder::Step step(out, "shard", "input");
  step.write("a-sample-of-many.tar", "");
  // In small letters libstdc++'s std::hash gives both the same number.
  EXPECT_NO_THROW(step.write("Hkd9g51_o-47trwz.tar", ""));
  EXPECT_THAT([&] { step.write("A-sample-of-many.tar", ""); },
              ThrowsMessage<InputError>(HasSubstr("got A-sample-of-many.tar beside another")));
}

}  // namespace
}  // namespace eventgan

#include "pipeline/training/training_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>
#include <stdexcept>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(TrainingLock, HoldsOthersOffAndSaysWhoItIs) {
  const testing::TemporaryFolder root;
  std::optional<TrainingLock> first(root / "out");
  EXPECT_THAT(
      [&] { TrainingLock second(root / "out"); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("process " + std::to_string(::getpid())),
                                              HasSubstr((root / "out").string()))));
  const TrainingLock elsewhere(root / "other");
  first.reset();
  EXPECT_NO_THROW(TrainingLock(root / "out"));
}

TEST(TrainingLock, NamesTheFileThatCannotBeMade) {
  EXPECT_THROW(TrainingLock("/proc/none"), std::runtime_error);
}

}  // namespace
}  // namespace eventgan

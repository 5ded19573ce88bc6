#include "pipeline/training/samples/training_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/pipeline/training/small_training.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(OpenTrainingRecordings, KnowsThePartInUse) {
  const testing::TemporaryFolder folder;
  testing::write_bar_recording(folder.path());
  RecordingSpec whole;
  whole.path = "bar.hdf5";
  RecordingSpec part = whole;
  part.path = (folder / "bar.hdf5").string();  // absolute paths too
  part.first_frame = 2;
  part.last_frame = 5;
  part.weight = 4;
  const auto opened =
      open_training_recordings(std::vector{whole, part}, folder.path(), {56, 64}, 1);
  ASSERT_EQ(opened.size(), 2u);
  EXPECT_EQ(opened[0].first_frame, 0);
  EXPECT_EQ(opened[0].last_frame, 8);
  EXPECT_EQ(opened[1].first_frame, 2);
  EXPECT_EQ(opened[1].last_frame, 5);
  EXPECT_EQ(opened[1].weight, 4);
}

TEST(OpenTrainingRecordings, ListsEveryRecordingOfNoUse) {
  const testing::TemporaryFolder folder;
  testing::write_bar_recording(folder.path());
  RecordingSpec beyond;
  beyond.path = "bar.hdf5";
  beyond.last_frame = 9;
  RecordingSpec late = beyond;
  late.last_frame.reset();
  late.first_frame = 8;
  try {
    open_training_recordings(std::vector{beyond, late}, folder.path(), {16, 16}, 2);
    FAIL() << "expected UsageError";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("expected last_frame below the number of frames, 9, got 9"),
                      HasSubstr("got frames 8 to 8"), HasSubstr("bar.hdf5")));
  }
  EXPECT_THROW(open_training_recordings(std::vector{late}, folder.path(), {57, 64}, 1), UsageError);
}

TEST(OpenTrainingRecordings, SaysWhatIsAbsent) {
  RecordingSpec absent;
  absent.path = "absent.hdf5";
  EXPECT_THROW(open_training_recordings(std::vector{absent}, "/nowhere", {16, 16}, 1), InputError);
}

}  // namespace
}  // namespace eventgan

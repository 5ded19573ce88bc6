#include "stages/frames/kitti/raw_mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kMapping =
    "2011_09_26 2011_09_26_drive_0005_sync 0000000109\n"
    "2011_09_26 2011_09_26_drive_0052_sync 0000000007\r\n"
    "2011_09_28 2011_09_28_drive_0222_sync 0000000053";

RawMapping parse(std::string_view rand, std::string_view mapping) {
  return {rand, "rand.txt", mapping, "mapping.txt"};
}

TEST(RawMapping, LeadsThroughThePermutationCountedFromOne) {
  const RawMapping mapping = parse("2,3,1\n", kMapping);
  EXPECT_EQ(mapping.find(0), (RawFrame{"2011_09_26", "2011_09_26_drive_0052_sync", 7}));
  EXPECT_EQ(mapping.find(1), (RawFrame{"2011_09_28", "2011_09_28_drive_0222_sync", 53}));
  EXPECT_EQ(mapping.find(2), (RawFrame{"2011_09_26", "2011_09_26_drive_0005_sync", 109}));
}

TEST(RawMapping, KnowsNoOtherPictures) {
  const RawMapping mapping = parse("2,3,1\n", kMapping);
  EXPECT_EQ(mapping.find(3), std::nullopt);
  EXPECT_EQ(mapping.find(-1), std::nullopt);
  EXPECT_EQ(parse("", "").find(0), std::nullopt);
}

void expect_error(std::string_view rand, std::string_view mapping, const std::string& got,
                  const std::string& where) {
  try {
    parse(rand, mapping);
    FAIL() << "took " << got;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr(got), HasSubstr(where)));
  }
}

TEST(RawMapping, AnythingElseIsAnErrorThatNamesTheFile) {
  expect_error("0", kMapping, "expected line numbers from 1 to 3, got '0'", "in rand.txt");
  expect_error("1,4", kMapping, "got '4'", "in rand.txt");
  expect_error("1,x", kMapping, "got 'x'", "in rand.txt");
  expect_error("1", "2011_09_26 drive\n", "expected DATE DRIVE FRAME", "mapping.txt:1");
  expect_error("1", "a b 1\n\na b 2\n", "got '?'", "mapping.txt:2");
  expect_error("1", "a b -1\n", "got 'a b -1?'", "mapping.txt:1");
}

TEST(RawMapping, LeadsToTheFramesTheDevkitNames) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto folder = data / "kitti_object/devkit/mapping";
  const RawMapping mapping = parse(testing::read_file(folder / "train_rand.txt"),
                                   testing::read_file(folder / "train_mapping.txt"));
  const std::string drive = "2011_09_26_drive_0052_sync";
  EXPECT_EQ(mapping.find(1497), (RawFrame{"2011_09_26", drive, 7}));
  EXPECT_EQ(mapping.find(4587), (RawFrame{"2011_09_26", drive, 14}));
  EXPECT_TRUE(mapping.find(7480));
  EXPECT_FALSE(mapping.find(7481));
}

}  // namespace
}  // namespace eventgan

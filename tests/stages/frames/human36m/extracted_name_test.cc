#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/frames/human36m/extracted_name_internal.h"

namespace eventgan {
namespace {

TEST(ExtractedNameTest, ReadsABareName) {
  const ExtractedName name = parse_extracted_name("S11_SittingDown 1.54138969_002061.jpg");
  EXPECT_EQ(name.folder, "S11/S11_SittingDown 1.54138969");
  EXPECT_EQ(name.sequence, "S11_SittingDown 1.54138969");
  EXPECT_EQ(name.subject, "S11");
  EXPECT_EQ(name.camera, "54138969");
  EXPECT_EQ(name.number, 2061);
}

TEST(ExtractedNameTest, TakesTheFolderFromAPath) {
  EXPECT_EQ(parse_extracted_name("images/S1_A.7_000001.jpg").folder, "images");
  EXPECT_EQ(parse_extracted_name("./a//b/S1_A.7_000001.jpg").folder, "a/b");
}

TEST(ExtractedNameTest, RefusesOtherNames) {
  for (const char* name :
       {"", "S1_A.7", "S1_A.7_.jpg", "S1_A.7_00000a.jpg", "S1_A_000001.jpg", "S1_A.x_000001.jpg",
        "S1_A._000001.jpg", "_A.7_000001.jpg", "S1.7_000001.jpg", "S1_A.7_0000000001.jpg",
        "/S1/S1_A.7_000001.jpg", "../S1_A.7_000001.jpg", "a/../S1_A.7_000001.jpg"}) {
    EXPECT_THROW(parse_extracted_name(name), std::invalid_argument) << name;
  }
}

}  // namespace
}  // namespace eventgan

#include <gtest/gtest.h>

#include "pipeline/folder/folder_status.h"

namespace eventgan {
namespace {

TEST(FaultKind, IsWhatIsWrongWithoutWhere) {
  EXPECT_EQ(fault_kind("expected a picture, got an empty file, in a/b.png"),
            "expected a picture, got an empty file");
  EXPECT_EQ(fault_kind("expected 15 columns, got 5, in label_2/000007.txt, in line 3 (KITTI)"),
            "expected 15 columns, got 5");
  EXPECT_EQ(fault_kind("broken\n  because: expected a box, got none, in a.txt"), "broken");
  EXPECT_EQ(fault_kind("out of luck"), "out of luck");
  EXPECT_EQ(fault_kind(""), "");
}

}  // namespace
}  // namespace eventgan

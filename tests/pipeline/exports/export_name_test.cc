#include <gtest/gtest.h>

#include "pipeline/exports/detail/exporter.h"

namespace eventgan {
namespace {

TEST(ExportName, KeepsWhatIsPlainWithoutFoldersOrDots) {
  EXPECT_EQ(export_name("000012"), "000012");
  EXPECT_EQ(export_name("Ab-9_z@before2"), "Ab-9_z@before2");
  EXPECT_EQ(export_name("S1/Walking-1/7/000006"), "S1+Walking-1+7+000006");
  EXPECT_EQ(export_name("a.b"), "a%2Eb");
  EXPECT_EQ(export_name("a+b c\xc3\xa9"), "a%2Bb%20c%C3%A9");
  EXPECT_NE(export_name("a/b"), export_name("a+b"));
}

TEST(ExportName, IsShortAndStillTellsIdsApart) {
  const std::string longest(75, 'a');
  EXPECT_EQ(export_name(longest), longest);
  const std::string one = export_name(longest + "b");
  const std::string other = export_name(longest + "c");
  EXPECT_EQ(one.size(), 75u);
  EXPECT_EQ(one.substr(0, 59), std::string(58, 'a') + "~");
  EXPECT_NE(one, other);
}

}  // namespace
}  // namespace eventgan

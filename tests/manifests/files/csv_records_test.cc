#include "manifests/files/csv_records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<CsvRecord> records_of(std::string_view text) {
  std::vector<CsvRecord> records;
  CsvReader reader(text);
  while (auto record = reader.next()) records.push_back(std::move(*record));
  return records;
}

TEST(CsvReader, HasFieldsBetweenCommas) {
  const auto records = records_of(
      "\xEF\xBB\xBF"
      "a, b\t,c\r\n\n \r\n,,\nlast");
  ASSERT_EQ(records.size(), 3u);
  EXPECT_THAT(records[0].fields, ElementsAre("a", "b", "c"));
  EXPECT_EQ(records[0].bytes, "a, b\t,c\r\n");
  EXPECT_EQ(records[0].line, 1);
  EXPECT_THAT(records[1].fields, ElementsAre("", "", ""));
  EXPECT_EQ(records[1].line, 4);
  EXPECT_THAT(records[2].fields, ElementsAre("last"));
  EXPECT_EQ(records[2].bytes, "last");
  EXPECT_EQ(records[2].line, 5);
}

TEST(CsvReader, TakesQuotesOff) {
  const auto records =
      records_of("\"a,b\", \"say \"\"x\"\"\" ,\"\"\n\"two\nlines\",\" y \"\r\n\"\"\"\"");
  ASSERT_EQ(records.size(), 3u);
  EXPECT_THAT(records[0].fields, ElementsAre("a,b", "say \"x\"", ""));
  EXPECT_THAT(records[1].fields, ElementsAre("two\nlines", " y "));
  EXPECT_EQ(records[1].line, 2);
  EXPECT_EQ(records[1].bytes, "\"two\nlines\",\" y \"\r\n");
  EXPECT_THAT(records[2].fields, ElementsAre("\""));
  EXPECT_THAT(records_of("\"\"\"a\"\"\"\"b\"").at(0).fields, ElementsAre("\"a\"\"b"));
  EXPECT_EQ(records[2].line, 4);
}

TEST(CsvReader, EndsAnywhere) {
  EXPECT_THAT(records_of(""), IsEmpty());
  EXPECT_THAT(records_of("\xEF\xBB\xBF"), IsEmpty());
  EXPECT_THAT(records_of("\n \n\t"), IsEmpty());
  EXPECT_THAT(records_of("a,").at(0).fields, ElementsAre("a", ""));
}

TEST(CsvReader, GoesOnBehindALineThatCannotBeRead) {
  const auto records = records_of("a\"b,1\n\"a\"b,2\n\xff,3\n\"open,4\nd,5\n");
  ASSERT_EQ(records.size(), 5u);
  EXPECT_THAT(records[0].fault, HasSubstr("got other quotes"));
  EXPECT_THAT(records[1].fault, HasSubstr("got other quotes"));
  EXPECT_EQ(records[2].fault, "expected UTF-8, got other bytes");
  EXPECT_THAT(records[3].fault, HasSubstr("got other quotes"));
  for (const std::size_t i : {0, 1, 3}) EXPECT_THAT(records[i].fields, IsEmpty()) << i;
  EXPECT_THAT(records[2].fields, ElementsAre("\xff", "3"));
  EXPECT_EQ(records[4].fault, "");
  EXPECT_THAT(records[4].fields, ElementsAre("d", "5"));
  EXPECT_EQ(records[4].line, 5);
}

TEST(CsvReader, LosesNoByte) {
  const std::string text = "a,b\r\n\"x\ny\",\"\"\n\"bad,\n\xff\nlast,1";
  std::string joined;
  for (const CsvRecord& record : records_of(text)) joined += record.bytes;
  EXPECT_EQ(joined, text);
}

}  // namespace
}  // namespace eventgan

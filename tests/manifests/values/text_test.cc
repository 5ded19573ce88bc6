#include "manifests/values/text.h"

#include <gtest/gtest.h>

#include "manifests/values/frames.h"

namespace eventgan {
namespace {

TEST(Text, CountsOneAndManyAndBytesWithThreeDigits) {
  EXPECT_EQ(to_string(ImageSize{480, 640}), "640x480");
  EXPECT_EQ(count_text(0, "pair"), "0 pairs");
  EXPECT_EQ(count_text(1, "pair"), "1 pair");
  EXPECT_EQ(count_text(12, "pair"), "12 pairs");
  EXPECT_EQ(count_text(1, "file", " left out"), "1 file left out");
  EXPECT_EQ(count_text(2, "file", " left out"), "2 files left out");
  EXPECT_EQ(count_text(2, "box"), "2 boxes");
  EXPECT_EQ(count_text(2, "batch"), "2 batches");
  EXPECT_EQ(count_text(2, "class"), "2 classes");
  EXPECT_EQ(count_text(2, "entry"), "2 entries");
  EXPECT_EQ(count_text(2, "ray"), "2 rays");
  EXPECT_EQ(count_text(-1, "entry"), "-1 entries");
  EXPECT_EQ(bytes_text(0), "0 bytes");
  EXPECT_EQ(bytes_text(999), "999 bytes");
  EXPECT_EQ(bytes_text(1000), "1 kB");
  EXPECT_EQ(bytes_text(1'234'567), "1.23 MB");
  EXPECT_EQ(bytes_text(999'400'000), "999 MB");
  EXPECT_EQ(bytes_text(999'600'000), "1 GB");
  EXPECT_EQ(bytes_text(25'000'000'000'000), "25 TB");
}

TEST(Text, JoinsAndNamesTheFirst) {
  using Classes = std::map<std::string, std::int64_t>;
  using Gaps = std::map<int, std::int64_t>;
  EXPECT_EQ(counts_text(Classes{{"Van", 1}, {"Car", 3}}), "Car: 3, Van: 1");
  EXPECT_EQ(counts_text(Gaps{{1, 3}, {2, 1}}, "gap "), "gap 1: 3, gap 2: 1");
  EXPECT_EQ(counts_text(Gaps{}, "gap "), "");
  const auto doubled = [](int value) { return 2 * value; };
  EXPECT_EQ(joined(std::vector{1, 2, 3}, " or ", doubled), "2 or 4 or 6");
  EXPECT_EQ(joined(std::map<int, int>{{1, 7}, {2, 8}}, "; ", &std::pair<const int, int>::second),
            "7; 8");
  EXPECT_EQ(joined(std::vector<int>{}, ", ", doubled), "");
  EXPECT_EQ(some_of({"a", "b"}, 2), "a, b");
  EXPECT_EQ(some_of({"a", "b", "c"}, 2), "a, b, ...");
  EXPECT_EQ(some_of({}, 2), "");
}

TEST(Trimmed, LeavesWhatIsBetweenBlanks) {
  EXPECT_EQ(trimmed(" \t a b\r\n"), "a b");
  EXPECT_EQ(trimmed("a"), "a");
  EXPECT_EQ(trimmed(" \r\n"), "");
  EXPECT_EQ(trimmed(""), "");
}

}  // namespace
}  // namespace eventgan

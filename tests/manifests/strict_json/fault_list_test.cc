#include <gtest/gtest.h>

#include <algorithm>

#include "manifests/strict_json/fault_list_internal.h"

namespace eventgan {
namespace {

TEST(FaultList, IsEmptyAtFirst) {
  const FaultList faults("m");
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(faults.text(), "");
}

TEST(FaultList, KeepsTheOrder) {
  FaultList faults("m");
  faults.add("$.b", "1", "2");
  faults.add("$.a", "x", "y");
  EXPECT_FALSE(faults.empty());
  EXPECT_EQ(faults.text(), "m: $.b: expected 1, got 2\nm: $.a: expected x, got y");
}

TEST(FaultList, CountsLinesAndCharactersFrom1) {
  const std::string text = "a\n\xc3\xa9z\n";  // line 2: é in two bytes (2, 3), then z
  const auto place = [&](std::size_t byte) {
    FaultList faults("m");
    faults.add_at(text, byte, "x", "y");
    return faults.text();
  };
  EXPECT_EQ(place(0), "m:1:1: expected x, got y");
  EXPECT_EQ(place(1), "m:1:2: expected x, got y");
  EXPECT_EQ(place(2), "m:2:1: expected x, got y");
  EXPECT_EQ(place(4), "m:2:2: expected x, got y");
  EXPECT_EQ(place(6), "m:3:1: expected x, got y");
  EXPECT_EQ(place(99), "m:3:1: expected x, got y");  // beyond the end is the end
}

TEST(FaultList, BeyondAThousandOnlyCounts) {
  FaultList faults("m");
  for (int i = 0; i < 1003; ++i) faults.add("$", "x", std::to_string(i));
  const std::string text = faults.text();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1000);
  EXPECT_TRUE(text.ends_with("m: $: expected x, got 999\nm: and 3 more faults"));
}

}  // namespace
}  // namespace eventgan

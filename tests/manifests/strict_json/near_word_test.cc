#include <gtest/gtest.h>

#include <array>
#include <string>

#include "manifests/strict_json/near_word_internal.h"

namespace eventgan {
namespace {

constexpr std::array<std::string_view, 4> kWords{"root", "split", "samples_per_shard", "raw_root"};

TEST(NearWord, FindsTheOneFewestEditsAway) {
  EXPECT_EQ(near_word("rot", kWords), "root");      // inserted
  EXPECT_EQ(near_word("splitt", kWords), "split");  // deleted
  EXPECT_EQ(near_word("Root", kWords), "root");     // replaced
  EXPECT_EQ(near_word("roto", kWords), "root");     // neighbours swapped
  EXPECT_EQ(near_word("raw_rot", kWords), "raw_root");
  EXPECT_EQ(near_word("sample_per_shards", kWords), "samples_per_shard");  // two edits
}

TEST(NearWord, FindsNoneFarAway) {
  EXPECT_EQ(near_word("rt", kWords), "");  // two edits, but "root" is short
  EXPECT_EQ(near_word("", kWords), "");
  EXPECT_EQ(near_word("directory", kWords), "");
  EXPECT_EQ(near_word("root", {}), "");
  EXPECT_EQ(near_word(std::string(1'000'000, 'r'), kWords), "");
}

TEST(NearWord, OfTwoEquallyNearTakesTheFirst) {
  constexpr std::array<std::string_view, 2> kTwo{"bat", "cat"};
  EXPECT_EQ(near_word("rat", kTwo), "bat");
}

}  // namespace
}  // namespace eventgan

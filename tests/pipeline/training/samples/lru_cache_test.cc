#include "pipeline/training/samples/lru_cache.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

using WordCache = LruCache<int, std::string>;

WordCache cache_of(std::size_t bytes) {
  return WordCache(bytes, [](const std::string& word) { return word.size(); });
}

TEST(LruCache, LoadsOnce) {
  WordCache cache = cache_of(10);
  int loads = 0;
  const auto load = [&] { return ++loads, std::string("abc"); };
  EXPECT_EQ(*cache.get(1, load), "abc");
  EXPECT_EQ(*cache.get(1, load), "abc");
  EXPECT_EQ(loads, 1);
  EXPECT_EQ(cache.kept_bytes(), 3u);
}

TEST(LruCache, ForgetsWhatWasUsedLongestAgo) {
  WordCache cache = cache_of(6);
  int loads = 0;
  const auto load = [&] { return ++loads, std::string("abc"); };
  cache.get(1, load);
  cache.get(2, load);
  cache.get(1, load);  // now 2 is the oldest
  cache.get(3, load);
  EXPECT_EQ(cache.kept_bytes(), 6u);
  EXPECT_EQ(loads, 3);
  cache.get(1, load);
  EXPECT_EQ(loads, 3);
  cache.get(2, load);
  EXPECT_EQ(loads, 4);
}

TEST(LruCache, HandsOutWhatIsTooBigAndKeepsTheRest) {
  WordCache cache = cache_of(4);
  cache.get(1, [] { return std::string("abc"); });
  EXPECT_EQ(cache.get(2, [] { return std::string("abcde"); })->size(), 5u);
  EXPECT_EQ(cache.kept_bytes(), 3u);
}

TEST(LruCache, AValueOutlivesItsPlace) {
  WordCache cache = cache_of(3);
  const auto first = cache.get(1, [] { return std::string("abc"); });
  cache.get(2, [] { return std::string("def"); });
  EXPECT_EQ(*first, "abc");
}

TEST(LruCache, AFailureIsNotKept) {
  WordCache cache = cache_of(10);
  const auto fail = []() -> std::string { throw std::runtime_error("no"); };
  EXPECT_THROW(cache.get(1, fail), std::runtime_error);
  EXPECT_EQ(*cache.get(1, [] { return std::string("abc"); }), "abc");
}

}  // namespace
}  // namespace eventgan

#include "stages/shards/contents_check.h"

#include <algorithm>
#include <utility>

namespace eventgan {
namespace {

std::string text_of(const std::string& key) { return key; }
std::string text_of(std::int64_t number) { return std::to_string(number); }

/// "Car: 3, Van: 1", or "none".
template <class Key>
std::string text_of(const std::map<Key, std::int64_t>& counts) {
  std::string text;
  for (const auto& [key, count] : counts) {
    text += (text.empty() ? "" : ", ") + text_of(key) + ": " + text_of(count);
  }
  return text.empty() ? "none" : text;
}

std::string text_of(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

class Comparison {
 public:
  template <class Value>
  void expect(const std::string& what, const Value& marker, const Value& shard) {
    if (marker == shard) return;
    faults_.push_back("expected " + what + " " + text_of(marker) + ", got " + text_of(shard));
  }

  /// Where many slots differ, the first tells enough.
  void expect_rows(const std::string& what, const std::vector<std::int32_t>& marker,
                   const std::vector<std::int32_t>& shard) {
    if (marker.size() != shard.size()) {
      return expect("number of slots with a count of " + what, std::ssize(marker),
                    std::ssize(shard));
    }
    const auto [expected, got] = std::mismatch(marker.begin(), marker.end(), shard.begin());
    if (expected == marker.end()) return;
    expect("number of " + what + " in slot " + std::to_string(expected - marker.begin()) + ":",
           std::int64_t{*expected}, std::int64_t{*got});
  }

  std::vector<std::string> take() { return std::move(faults_); }

 private:
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> contents_faults(const ShardContents& marker, const ShardContents& shard) {
  Comparison comparison;
  comparison.expect_rows("boxes", marker.boxes, shard.boxes);
  comparison.expect_rows("persons", marker.persons, shard.persons);
  comparison.expect("boxes by class", marker.classes, shard.classes);
  comparison.expect("samples by gap", marker.gaps, shard.gaps);
  comparison.expect("optional columns", marker.optional_columns, shard.optional_columns);
  return comparison.take();
}

}  // namespace eventgan

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "manifests/strict_json/near_word_internal.h"

namespace eventgan {
namespace {

/// Letters to insert, delete or replace, and neighbours to swap (optimal string alignment
/// distance).
std::size_t edits(std::string_view from, std::string_view to) {
  // Three rows of the table of distances between beginnings: of from's first i-2, i-1 and i
  // letters.
  std::vector<std::size_t> before, last(to.size() + 1), row(to.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= from.size(); ++i) {
    row[0] = i;
    for (std::size_t k = 1; k <= to.size(); ++k) {
      const std::size_t replaced = last[k - 1] + (from[i - 1] == to[k - 1] ? 0 : 1);
      row[k] = std::min({replaced, last[k] + 1, row[k - 1] + 1});
      const bool swapped = i > 1 && k > 1 && from[i - 1] == to[k - 2] && from[i - 2] == to[k - 1];
      if (swapped) row[k] = std::min(row[k], before[k - 2] + 1);
    }
    before = std::exchange(last, row);
  }
  return last.back();
}

}  // namespace

std::string_view near_word(std::string_view word, std::span<const std::string_view> known) {
  constexpr std::size_t kLongest = 64;  // no key is longer, and the table's size is a product
  if (word.size() > kLongest) return {};
  std::string_view nearest;
  std::size_t fewest = kLongest;
  for (const std::string_view candidate : known) {
    const std::size_t count = edits(word, candidate);
    if (count < fewest && count <= std::max<std::size_t>(1, candidate.size() / 3)) {
      fewest = count;
      nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace eventgan

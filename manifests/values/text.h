#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace eventgan {

// How messages and pages write what many of them have. Thread safe.

/// "1 pair", "2 pairs"; "2 boxes", "2 batches", "2 entries". Every count in a message goes through
/// it. `rest` follows the noun: count_text(2, "file", " left out") is "2 files left out".
std::string count_text(std::int64_t count, const std::string& noun, const std::string& rest = "");

/// "12.3 MB": three digits, in the largest of TB, GB, MB and kB that is not above it; below 1 kB
/// "45 bytes".
std::string bytes_text(std::int64_t bytes);

/// "Car: 3, Van: 1", and with the name "gap ", "gap 1: 3, gap 2: 1". Empty if there are none.
template <class Key>
std::string counts_text(const std::map<Key, std::int64_t>& counts, std::string_view name = "") {
  std::ostringstream text;
  const char* between = "";
  for (const auto& [key, count] : counts) {
    text << std::exchange(between, ", ") << name << key << ": " << count;
  }
  return text.str();
}

/// What `text_of`, a function or a member, says of each of the items, with `between` between them.
template <class Items, class TextOf>
std::string joined(const Items& items, std::string_view between, TextOf text_of) {
  std::ostringstream text;
  std::string_view before;
  for (const auto& item : items) {
    text << std::exchange(before, between) << std::invoke(text_of, item);
  }
  return text.str();
}

/// "a, b, c", or if there are more than `most`, these and "...".
std::string some_of(const std::vector<std::string>& names, std::size_t most);

/// Without blanks, tabs and line ends around it. A view into `text`.
std::string_view trimmed(std::string_view text);

}  // namespace eventgan

#include "manifests/documents/strict_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"

namespace eventgan {
namespace {

using Json = nlohmann::json;

/// A value as JSON in ASCII, so that no message can garble a terminal; cut if it is long.
std::string shown(const Json& value) {
  constexpr std::size_t kLongest = 80;
  std::string text = dump_json(value, JsonLayout::kAsciiLine);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

std::string shortest(double value) {
  std::array<char, 32> digits;
  const auto result = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  return {digits.data(), result.ptr};
}

}  // namespace

StrictValue::StrictValue(const Json& document, FaultList& faults)
    : StrictValue(document, "$", faults) {}

StrictValue::StrictValue(const Json& part, std::string path, FaultList& faults)
    : StrictValue(&part, State::kPresent, std::move(path), faults) {}

StrictValue::StrictValue(const Json* node, State state, std::string path, FaultList& faults)
    : node_(node), state_(state), path_(std::move(path)), faults_(&faults) {}

std::optional<std::int64_t> StrictValue::sound_integer(std::int64_t lowest,
                                                       std::int64_t highest) const {
  if (node_ != nullptr && node_->is_number_integer()) {
    // What is above 2^63-1 is unsigned in nlohmann's hands; as a signed number it would be
    // negative.
    const bool is_huge = node_->is_number_unsigned() && node_->get<std::uint64_t>() > INT64_MAX;
    const auto value = node_->get<std::int64_t>();
    if (!is_huge && value >= lowest && value <= highest) return value;
  }
  fault("an integer " + std::to_string(lowest) + ".." + std::to_string(highest));
  return std::nullopt;
}

std::optional<double> StrictValue::sound_number(double lowest, double highest) const {
  if (node_ != nullptr && node_->is_number()) {
    const auto value = node_->get<double>();
    if (value >= lowest && value <= highest) return value;
  }
  fault("a number " + shortest(lowest) + ".." + shortest(highest));
  return std::nullopt;
}

bool StrictValue::boolean() const {
  if (is_boolean()) return node_->get<bool>();
  fault("true or false");
  return false;
}

std::string StrictValue::text() const {
  return text("text", [](std::string_view) { return true; });
}

std::string StrictValue::text(std::string_view expected, bool (*is_right)(std::string_view)) const {
  const auto* text = node_ == nullptr ? nullptr : node_->get_ptr<const std::string*>();
  if (text != nullptr && is_right(*text)) return *text;
  fault(expected);
  return {};
}

std::optional<std::size_t> StrictValue::index_of_choice(
    std::span<const std::string_view> words) const {
  const auto* text = node_ == nullptr ? nullptr : node_->get_ptr<const std::string*>();
  std::string listed;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (text != nullptr && *text == words[i]) return i;
    listed.append(i == 0 ? "" : i + 1 < words.size() ? ", " : " or ").append("\"").append(words[i]);
    listed.append("\"");
  }
  fault(listed);
  return std::nullopt;
}

std::vector<StrictValue> StrictValue::elements(std::size_t least) const {
  std::vector<StrictValue> elements;
  if (node_ == nullptr || !node_->is_array() || node_->size() < least) {
    fault(least == 0 ? "an array" : "an array of " + std::to_string(least) + " or more");
    return elements;
  }
  elements.reserve(node_->size());
  for (const Json& element : *node_) {
    const std::string path = json_path(path_, elements.size());
    elements.push_back(StrictValue(&element, State::kPresent, path, *faults_));
  }
  return elements;
}

std::vector<std::pair<std::string, StrictValue>> StrictValue::members() const {
  std::vector<std::pair<std::string, StrictValue>> members;
  if (node_ == nullptr || !node_->is_object()) {
    fault("an object");
    return members;
  }
  for (const auto& [key, value] : node_->items()) {
    members.emplace_back(key,
                         StrictValue(&value, State::kPresent, json_path(path_, key), *faults_));
  }
  return members;
}

StrictObject StrictValue::object() const {
  const bool is_object = node_ != nullptr && node_->is_object();
  if (!is_object) fault("an object");
  return StrictObject(is_object ? node_ : nullptr, path_, *faults_);
}

void StrictValue::fault(std::string_view expected) const { fault(expected, description()); }

void StrictValue::fault(std::string_view expected, std::string_view got) const {
  if (state_ != State::kSilent) faults_->add(path_, expected, got);
}

std::string StrictValue::description() const {
  if (node_ == nullptr) return "nothing";
  if (node_->is_object()) return "an object";
  if (node_->is_array()) return "an array of " + std::to_string(node_->size());
  return shown(*node_);
}

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

StrictObject::StrictObject(const nlohmann::json* node, std::string path, FaultList& faults)
    : node_(node), path_(std::move(path)), faults_(&faults) {}

StrictValue StrictObject::at(std::string_view key) {
  if (auto value = find(key)) return *std::move(value);
  const auto state = node_ == nullptr ? StrictValue::State::kSilent : StrictValue::State::kMissing;
  return StrictValue(nullptr, state, json_path(path_, key), *faults_);
}

std::optional<StrictValue> StrictObject::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  if (node_ == nullptr) return std::nullopt;
  const auto found = node_->find(key);
  if (found == node_->end()) return std::nullopt;
  return StrictValue(&*found, StrictValue::State::kPresent, json_path(path_, key), *faults_);
}

bool StrictObject::has_format(std::string_view format, int version) {
  const bool is_format = has_format_name(format);
  const StrictValue found_version = at("version");
  const bool is_version = found_version.node_ != nullptr &&
                          found_version.node_->is_number_integer() &&
                          *found_version.node_ == version;
  if (!is_version) {
    found_version.fault(std::to_string(version) + " (the version that this program reads)");
  }
  return is_format && is_version;
}

bool StrictObject::has_format(std::string_view format, FormatVersion own) {
  const bool is_format = has_format_name(format);
  const StrictValue found = at("version");
  const auto version = found.is_text()
                           ? readable_version(found.node_->get_ref<const std::string&>(), own)
                           : std::nullopt;
  if (!version) found.fault(readable_versions(own));
  if (version && version->minor > own.minor) faults_->allow_unknown_keys();
  return is_format && version;
}

bool StrictObject::has_format_name(std::string_view format) {
  const StrictValue found = at("format");
  const bool is_format = found.node_ != nullptr && *found.node_ == format;
  if (!is_format) found.fault("\"" + std::string(format) + "\"");
  return is_format;
}

void StrictObject::finish() const {
  if (node_ == nullptr) return;
  for (const auto& [key, value] : node_->items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    if (faults_->allows_unknown_keys()) {
      faults_->add_unknown_key(json_path(path_, key));
      continue;
    }
    const std::string_view meant = near_word(key, known_);
    if (!meant.empty() && !node_->contains(std::string(meant))) {
      faults_->drop_missing(json_path(path_, meant));
    }
    const std::string expected = meant.empty()
                                     ? fmt::format("one of the keys {}", fmt::join(known_, ", "))
                                     : fmt::format("the key \"{}\" or none", meant);
    faults_->add(json_path(path_, key), expected, "an unknown key");
  }
}

}  // namespace eventgan

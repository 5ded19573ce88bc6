#include <charconv>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_path_internal.h"
#include "manifests/strict_json/json_text_internal.h"
#include "manifests/strict_json/strict_json_internal.h"

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

double StrictValue::number(double lowest, double highest) const {
  if (node_ != nullptr && node_->is_number()) {
    const auto value = node_->get<double>();
    if (value >= lowest && value <= highest) return value;
  }
  fault("a number " + shortest(lowest) + ".." + shortest(highest));
  return lowest;
}

bool StrictValue::boolean() const {
  if (node_ != nullptr && node_->is_boolean()) return node_->get<bool>();
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

}  // namespace eventgan

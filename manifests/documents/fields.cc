#include "manifests/documents/detail/fields.h"

#include <algorithm>
#include <cmath>

#include "manifests/documents/detail/manifest_file.h"

namespace eventgan {
namespace {

/// Whole numbers without ".0", as people write them.
Schema tidy(const Schema& value) {
  if (value.is_number_float()) {
    const double number = value;
    if (std::floor(number) == number && std::abs(number) < 1e15) {
      return static_cast<std::int64_t>(number);
    }
  }
  if (!value.is_structured()) return value;
  Schema tidied = value;
  for (Schema& element : tidied) element = tidy(element);
  return tidied;
}

Schema number_schema(double least, double most) {
  return {{"type", "number"}, {"minimum", tidy(least)}, {"maximum", tidy(most)}};
}

}  // namespace

bool Fields::has_format(std::string_view format, int version) {
  if (object_) {
    is_finished_ = !object_->has_format(format, version);  // another's keys are not unknown ones
    return !is_finished_;
  }
  if (schema_) {
    describe("format", {{"const", format}}, "Says what kind of document it is.", true);
    describe("version", {{"const", version}}, "Version of the document's format.", true);
  } else {
    json_["format"] = format;
    json_["version"] = version;
  }
  return true;
}

void Fields::describe(std::string_view key, const Schema& schema, std::string_view what,
                      bool is_required) {
  Schema property = {{"description", what}};
  property.update(schema);
  (*schema_)["properties"][std::string(key)] = std::move(property);
  if (is_required) (*schema_)["required"].push_back(key);
}

void Fields::state_default(std::string_view key, const Schema& value) {
  if (!is_empty(value)) (*schema_)["properties"][std::string(key)]["default"] = tidy(value);
}

void Fields::set_kind(std::string_view key, std::string_view word, std::string_view fallback) {
  kind_key_ = key;
  kind_ = is_sound(key) ? word : "";
  default_kind_ = fallback;
}

Fields::Owned& Fields::owned_by(const Kinds& owners) {
  const auto same = std::ranges::find(owned_, owners, &Owned::owners);
  return same == owned_.end() ? owned_.emplace_back(Owned{owners, {}, {}}) : *same;
}

bool Fields::may_have(std::string_view key, const Only::Owners& owners) {
  if (schema_) {
    if (kind_key_.empty()) return true;  // of an outer object, whose table has the rule
    owned_by(owners.may).keys.emplace_back(key);
    if (!owners.must.empty()) owned_by(owners.must).required.emplace_back(key);
    return true;
  }
  if (kind_.empty() || std::ranges::find(owners.may, kind_) != owners.may.end()) return true;
  if (const auto found = peek(key)) {
    found->fault(fmt::format("no such key for {} \"{}\" (only for {})", kind_key_, kind_,
                             fmt::join(owners.may, ", ")));
    misplaced_.push_back(key);
  }
  return false;
}

/// "mpii, recording: the labels. Required of mpii."
std::string Fields::of_kinds(const Only::Owners& owners, std::string_view what) {
  std::string told = fmt::format("{}: {}", fmt::join(owners.may, ", "), what);
  if (owners.must.empty()) return told;
  if (owners.must == owners.may) return told + " Required.";
  return told + fmt::format(" Required of {}.", fmt::join(owners.must, ", "));
}

void Fields::needs(std::string_view second, std::string_view first) {
  if (object_) {
    const auto found = peek(second);
    if (found && !peek(first)) found->fault(std::string(first) + " beside it", "none");
  } else if (schema_) {
    (*schema_)["dependencies"][std::string(second)] = Schema::array({first});
  }
}

void Fields::sets(std::string_view first, std::initializer_list<std::string_view> others) {
  for (const std::string_view other : others) {
    const Schema both = {{"required", Schema::array({first, other})}};
    rule({{"not", both}});
    const auto found = peek(other);
    if (found && peek(first)) {
      found->fault(fmt::format("no such key together with {}, which sets it", first));
    }
  }
}

void Fields::rule(const Schema& schema) {
  if (schema_) (*schema_)["allOf"].push_back(schema);
}

Fields::Schema Fields::schema() const {
  Schema schema = {{"type", "object"}, {"additionalProperties", false}};
  schema.update(*schema_);
  for (const Owned& owned : owned_) {
    Schema is_owner = {{"properties", {{std::string(kind_key_), {{"enum", owned.owners}}}}}};
    // A kind that is left out is the default; one that must be there is a fault of its own.
    const bool may_be_left_out =
        default_kind_.empty() ||
        std::ranges::find(owned.owners, default_kind_) != owned.owners.end();
    if (!may_be_left_out) is_owner["required"] = Schema::array({kind_key_});
    Schema rule = {{"if", is_owner}};
    if (!owned.required.empty()) rule["then"] = {{"required", owned.required}};
    for (const std::string& key : owned.keys) rule["else"]["properties"][key] = false;
    schema["allOf"].push_back(std::move(rule));
  }
  return schema;
}

Schema Numbers::schema(double) const { return number_schema(least, most); }
Schema Numbers::json(double member) const { return member; }

Texts paths() {
  return {"a path",
          [](std::string_view text) { return !text.empty() && text.find('\0') == text.npos; },
          R"({"title": "path", "type": "string", "pattern": "^[^\\u0000]+$"})"};
}

// Hidden files and temporaries begin with ".", options of commands with "-". Two names, a number
// and a temporary's suffix stay below the file systems' limit of 255 bytes.
Texts names() {
  return {
      "1..64 letters, digits, \".\", \"_\" or \"-\", not beginning with \".\" or \"-\"", is_name,
      R"({"title": "name", "type": "string", "pattern": "^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$"})"};
}

Texts stereo_cameras() {
  return {"\"left\" or \"right\"",
          [](std::string_view text) { return text == "left" || text == "right"; },
          R"({"enum": ["left", "right"]})"};
}

void Pairs::read(const StrictValue& value, std::array<double, 2>& member) const {
  member = {least, least};
  if (or_number && !value.is_array()) {
    member.fill(value.number(least, most));
    return;
  }
  const std::vector<StrictValue> both = value.elements(2);
  if (both.size() != 2) {
    if (!both.empty()) value.fault("an array of 2");
    return;
  }
  const auto first = both[0].sound_number(least, most), second = both[1].sound_number(least, most);
  if (!first || !second) return;
  member = {*first, *second};
  if (ends == Ends::kNotBelow && member[1] < member[0]) {
    both[1].fault("a number not below the previous one");
  } else if (ends == Ends::kAbove && member[1] <= member[0]) {
    both[1].fault("a number above the previous one");
  }
}

Schema Pairs::schema(const std::array<double, 2>&) const {
  const Schema number = number_schema(least, most);
  const Schema both = {{"type", "array"}, {"minItems", 2}, {"maxItems", 2}, {"items", number}};
  if (!or_number) return both;
  return {{"anyOf", Schema::array({number, both})}};
}

Schema Pairs::json(const std::array<double, 2>& member) const {
  if (or_number && member[0] == member[1]) return member[0];
  return member;
}

namespace {

Objects<ImageSize, std::function<void(Fields&, ImageSize&)>> size_object(int least, int most) {
  return {[=](Fields& fields, ImageSize& size) {
    fields.at("height", size.height, integers(least, most), "Height in pixels.");
    fields.at("width", size.width, integers(least, most), "Width in pixels.");
  }};
}

}  // namespace

void Sizes::read(const StrictValue& value, ImageSize& member) const {
  size_object(least, most).read(value, member);
}
Schema Sizes::schema(const ImageSize& size) const { return size_object(least, most).schema(size); }
Schema Sizes::json(const ImageSize& member) const { return size_object(least, most).json(member); }

void Gaps::read(const StrictValue& value, std::vector<int>& member) const {
  member.clear();
  for (const StrictValue& element : value.elements(1)) {
    const auto gap = element.sound_integer(1, 6);
    if (!gap) continue;
    if (side == PairSide::kAround && *gap % 2 != 0) {
      element.fault("an even gap (2, 4 or 6), since side is \"around\"");
    }
    if (std::ranges::find(member, *gap) != member.end()) element.fault("each gap once");
    member.push_back(static_cast<int>(*gap));
  }
  std::ranges::sort(member);
}

Schema Gaps::schema(const std::vector<int>&) const {
  return {{"type", "array"},
          {"minItems", 1},
          {"uniqueItems", true},
          {"items", {{"type", "integer"}, {"minimum", 1}, {"maximum", 6}}}};
}

}  // namespace eventgan

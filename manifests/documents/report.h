#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/shard.h"

namespace eventgan {

/// A row of the table that a report is: its JSON document and its text come from the same rows.
///
///   return {{"pairs", fit.pairs},                                        // in JSON alone
///           {"lost", fit.lost, count_text(fit.lost, "pair") + " lost"},  // and in the text
///           fit.folder};                                                 // in the text alone
struct ReportRow {
  ReportRow(std::string_view name, nlohmann::json figure, std::string words = {})
      : key(name), value(std::move(figure)), text(std::move(words)) {}
  ReportRow(std::string words) : text(std::move(words)) {}

  std::string_view key;  ///< none: the row is in the text alone
  nlohmann::json value;
  std::string text;  ///< lines, left out where the value of a key is zero, false or empty
};

using Report = std::vector<ReportRow>;

/// The texts in the order of the rows; a row that has some begins on a line of its own.
std::string text_of(const Report& report);

/// An object of the keys.
nlohmann::json json_of(const Report& report);

/// The same as text, with a line end behind it.
std::string json_text_of(const Report& report, JsonLayout layout = JsonLayout::kLine);

/// An array of what `json_of_item`, a function or a member, makes of each item.
template <class Items, class JsonOf>
nlohmann::json json_list(const Items& items, const JsonOf& json_of_item) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& item : items) list.push_back(nlohmann::json(std::invoke(json_of_item, item)));
  return list;
}

/// A line for each of the first `most` items, its control characters escaped; then how many more
/// there are, and `where`: "... and 5 more (in plan.json)".
template <class Items, class LineOf>
std::string listed(const Items& items, std::ptrdiff_t most, const char* where,
                   const LineOf& line_of) {
  std::string text;
  const std::ptrdiff_t shown = std::min(most, std::ssize(items));
  for (auto item = items.begin(); item != items.begin() + shown; ++item) {
    text += escape_controls(std::invoke(line_of, *item)) + "\n";
  }
  if (shown == std::ssize(items)) return text;
  return text + fmt::format("... and {} more{}\n", std::ssize(items) - shown, where);
}

/// As lists of quarantined samples have it.
void to_json(nlohmann::json& json, const QuarantinedSlot& sample);

/// All of them, each in the place of {} in `line`.
std::string listed(const std::vector<std::string>& items, const char* line = "{}");

}  // namespace eventgan

#include "stages/frames/csv_records.h"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/text.h"

namespace eventgan {
namespace {

/// Takes the field at the start of `text`, up to what ends it: a separator, a line end, or nothing.
/// None if its quotes do not match; then nothing is taken.
std::optional<std::string> take_field(std::string_view& text, char separator) {
  const std::array ends{separator, '\n', '\0'};
  const char* const blanks = separator == '\t' ? " " : " \t";
  const std::size_t begin = std::min(text.find_first_not_of(blanks), text.size());
  std::string field;
  std::size_t end = begin;
  if (begin < text.size() && text[begin] == '"') {
    for (end = begin + 1;; ++end) {
      const std::size_t quote = text.find('"', end);
      if (quote == std::string_view::npos) return std::nullopt;
      field.append(text.substr(end, quote - end));
      end = quote + 1;
      if (end == text.size() || text[end] != '"') break;
      field += '"';
    }
    const std::size_t stop = std::min(text.find_first_of(ends.data(), end), text.size());
    if (!trimmed(text.substr(end, stop - end)).empty()) return std::nullopt;
    end = stop;
  } else {
    end = std::min(text.find_first_of(ends.data(), begin), text.size());
    field = trimmed(text.substr(begin, end - begin));
    if (field.find('"') != std::string::npos) return std::nullopt;
  }
  text.remove_prefix(end);
  return field;
}

std::size_t line_length(std::string_view text) {
  const std::size_t end = text.find('\n');
  return end == std::string_view::npos ? text.size() : end + 1;
}

}  // namespace

CsvReader::CsvReader(std::string_view text, char separator) : rest_(text), separator_(separator) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (rest_.starts_with(kMark)) rest_.remove_prefix(kMark.size());
}

std::optional<CsvRecord> CsvReader::next() {
  while (!rest_.empty() && trimmed(rest_.substr(0, rest_.find('\n'))).empty()) {
    rest_.remove_prefix(line_length(rest_));
    ++line_;
  }
  if (rest_.empty()) return std::nullopt;

  CsvRecord record;
  record.line = line_;
  std::string_view after = rest_;
  for (bool goes_on = true; goes_on;) {
    std::optional<std::string> field = take_field(after, separator_);
    if (!field) {
      record.fault = "expected a field without quotes, or in quotes as a whole, got other quotes";
      record.fields.clear();
      after = rest_.substr(line_length(rest_));
      break;
    }
    record.fields.push_back(std::move(*field));
    goes_on = after.starts_with(separator_);
    if (!after.empty()) after.remove_prefix(1);
  }
  record.bytes = rest_.substr(0, rest_.size() - after.size());
  if (!utf8::is_valid(record.bytes)) {
    record.fault = "expected UTF-8, got other bytes";
    record.fields.clear();
  }
  line_ += static_cast<int>(std::ranges::count(record.bytes, '\n'));
  rest_ = after;
  return record;
}

Outcome<std::vector<std::optional<std::size_t>>> csv_columns(
    const CsvRecord& header, std::span<const std::string_view> names, std::size_t required) {
  std::vector<std::optional<std::size_t>> places(names.size());
  for (std::size_t i = 0; i < header.fields.size(); ++i) {
    const auto name = std::ranges::find(names, header.fields[i]);
    if (name == names.end() || places[static_cast<std::size_t>(name - names.begin())]) {
      return SampleFault{fmt::format("expected columns {}, each once, got \"{}\"",
                                     fmt::join(names, ", "), escape_controls(header.fields[i]))};
    }
    places[static_cast<std::size_t>(name - names.begin())] = i;
  }
  for (std::size_t i = 0; i < required; ++i) {
    if (!places[i]) return SampleFault{fmt::format("expected a column {}, got none", names[i])};
  }
  return places;
}

}  // namespace eventgan

#include "manifests/files/csv_records.h"

#include <utf8.h>

#include <algorithm>
#include <utility>

#include "manifests/values/text.h"

namespace eventgan {
namespace {

// A table of events has millions of rows: what most fields do not need is not called for them.

/// Where a field that goes on at `from` ends.
std::size_t end_of_field(std::string_view text, char separator, std::size_t from) {
  while (from < text.size() && text[from] != separator && text[from] != '\n') ++from;
  return from;
}

/// Takes the field at the start of `text`, and what ends it: a separator, a line end, or nothing,
/// into the record. If its quotes do not match, nothing is taken, and it gives false.
bool take_field(std::string_view& text, char separator, CsvRecord& record) {
  const char* const blanks = separator == '\t' ? " " : " \t";
  const std::size_t begin = std::min(text.find_first_not_of(blanks), text.size());
  std::string_view field;
  std::size_t end = begin;
  if (begin < text.size() && text[begin] == '"') {
    std::string unquoted;  // up to the last doubled quote
    std::size_t from = begin + 1;
    for (;;) {
      end = text.find('"', from);
      if (end == std::string_view::npos) return false;
      field = text.substr(from, end - from);
      if (++end == text.size() || text[end] != '"') break;
      unquoted.append(field) += '"';
      from = end + 1;
    }
    if (!unquoted.empty()) {
      unquoted.append(field);
      record.unquoted.push_back(std::make_unique<const std::string>(std::move(unquoted)));
      field = *record.unquoted.back();
    }
    const std::size_t stop = end_of_field(text, separator, end);
    if (!trimmed(text.substr(end, stop - end)).empty()) return false;
    end = stop;
  } else {
    end = end_of_field(text, separator, begin);
    field = text.substr(begin, end - begin);
    if (!field.empty() && (field.front() <= ' ' || field.back() <= ' ')) field = trimmed(field);
    if (field.find('"') != std::string_view::npos) return false;
  }
  text.remove_prefix(end);
  record.fields.push_back(field);
  return true;
}

std::size_t line_length(std::string_view text) {
  const std::size_t end = text.find('\n');
  return end == std::string_view::npos ? text.size() : end + 1;
}

}  // namespace

char separator_of(std::string_view text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  if (line.find(',') != std::string_view::npos) return ',';
  if (line.find(';') != std::string_view::npos) return ';';
  return line.find('\t') != std::string_view::npos ? '\t' : ',';
}

CsvReader::CsvReader(std::string_view text, char separator) : rest_(text), separator_(separator) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (rest_.starts_with(kMark)) rest_.remove_prefix(kMark.size());
}

std::optional<CsvRecord> CsvReader::next() {
  while (!rest_.empty() && rest_.front() <= ' ' &&
         trimmed(rest_.substr(0, rest_.find('\n'))).empty()) {
    rest_.remove_prefix(line_length(rest_));
    ++line_;
  }
  if (rest_.empty()) return std::nullopt;

  CsvRecord record;
  record.line = line_;
  record.fields.reserve(8);
  std::string_view after = rest_;
  for (bool goes_on = true; goes_on;) {
    if (!take_field(after, separator_, record)) {
      record.fault = "expected a field without quotes, or in quotes as a whole, got other quotes";
      record.fields.clear();
      after = rest_.substr(line_length(rest_));
      break;
    }
    goes_on = after.starts_with(separator_);
    if (!after.empty()) after.remove_prefix(1);
  }
  record.bytes = rest_.substr(0, rest_.size() - after.size());
  if (!utf8::is_valid(record.bytes)) {
    record.fault = "expected UTF-8, got other bytes";
  }
  line_ += static_cast<int>(std::ranges::count(record.bytes, '\n'));
  rest_ = after;
  return record;
}

}  // namespace eventgan

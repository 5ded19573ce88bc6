#include "pipeline/training/csv_table.h"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>

#include "manifests/files/atomic_file.h"

namespace eventgan {
namespace {

std::string joined(const CsvTable::Row& row) { return fmt::format("{}\n", fmt::join(row, ",")); }

CsvTable::Row split(const std::string& line) {
  CsvTable::Row row(1);
  for (const char c : line) {
    if (c == ',') {
      row.emplace_back();
    } else {
      row.back() += c;
    }
  }
  return row;
}

/// The file's lines that end in a line end.
std::vector<std::string> whole_lines(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line) && !stream.eof();) lines.push_back(line);
  return lines;
}

}  // namespace

CsvTable::CsvTable(const std::filesystem::path& file, const Row& columns,
                   const std::function<bool(const Row&)>& keep)
    : file_(file) {
  const std::vector<std::string> lines = whole_lines(file);
  std::string text = joined(columns);
  if (!lines.empty() && lines.front() + '\n' == text) {
    for (std::size_t i = 1; i < lines.size(); ++i) {
      Row row = split(lines[i]);
      if (row.size() != columns.size() || !keep(row)) break;
      text += lines[i] + '\n';
      kept_.push_back(std::move(row));
    }
  }
  write_file_atomically(file, text);
  stream_.open(file, std::ios::binary | std::ios::app);
  if (!stream_) throw std::runtime_error("cannot write " + file.string());
}

void CsvTable::add(const Row& row) {
  stream_ << joined(row);
  if (!stream_) throw_system_error("cannot write " + file_.string(), errno);
}

void CsvTable::flush() {
  stream_.flush();
  if (!stream_) throw_system_error("cannot write " + file_.string(), errno);
}

std::string csv_number(double value) {
  return std::isnan(value) ? "" : fmt::format("{:.6g}", value);
}

double csv_value(const std::string& cell) {
  double value = 0;
  const char* last = cell.data() + cell.size();
  const auto [end, error] = std::from_chars(cell.data(), last, value);
  const bool whole = error == std::errc{} && end == last;
  return whole ? value : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace eventgan

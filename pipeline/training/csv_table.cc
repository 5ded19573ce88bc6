#include "pipeline/training/csv_table.h"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "manifests/files/atomic_file.h"
#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

std::string joined(const CsvTable::Row& row) { return fmt::format("{}\n", fmt::join(row, ",")); }

}  // namespace

CsvTable::CsvTable(const std::filesystem::path& file, const Row& columns,
                   const std::function<bool(const Row&)>& keep)
    : file_(file) {
  std::string reason;  // of a file that is not there yet
  std::string before = try_read_file(file, reason).value_or("");
  before.erase(before.rfind('\n') + 1);  // the row that a killed run wrote; without a line end, all
  std::string text = joined(columns);
  CsvReader reader(before);
  if (const auto header = reader.next(); header && header->bytes == text) {
    while (const auto record = reader.next()) {
      Row row(record->fields.begin(), record->fields.end());
      if (row.size() != columns.size() || !keep(row)) break;
      text += record->bytes;
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

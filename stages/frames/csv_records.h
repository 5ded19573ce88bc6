#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {

/// A record of a table: mostly a line.
struct CsvRecord {
  std::string_view bytes;           ///< as in the text, with its line end, if it has one
  int line = 0;                     ///< where it begins, from 1
  std::vector<std::string> fields;  ///< none if there is a fault
  std::string fault;                ///< "expected X, got Y" where it cannot be read, else empty
};

/// Reads comma-separated values as RFC 4180 has them, UTF-8, lines ended by LF or CRLF: a field in
/// quotes may have commas, line ends and doubled quotes in it; blanks around a field do not count,
/// but within its quotes. A byte order mark and blank lines are passed over. Not thread safe.
class CsvReader {
 public:
  /// A view of `text` is kept. `separator` stands between fields.
  explicit CsvReader(std::string_view text, char separator = ',');

  /// None at the end. A record that cannot be read goes to the end of its line.
  std::optional<CsvRecord> next();

 private:
  std::string_view rest_;
  char separator_;
  int line_ = 1;
};

/// The place of each of `names` in a table's records by its header, `std::nullopt` of a column that
/// is absent. The first `required` must be there, all at most once, and no others; else a fault
/// "expected X, got Y".
Outcome<std::vector<std::optional<std::size_t>>> csv_columns(
    const CsvRecord& header, std::span<const std::string_view> names, std::size_t required);

}  // namespace eventgan

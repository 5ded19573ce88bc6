#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// A record of a table: mostly a line. It views the text.
struct CsvRecord {
  std::string_view bytes;  ///< with its line end, if it has one
  int line = 0;            ///< where it begins, from 1
  /// None if the quotes are at fault. What is not UTF-8 is here as it is.
  std::vector<std::string_view> fields;
  std::string fault;  ///< "expected X, got Y" where it cannot be read, else empty
  /// What fields with doubled quotes view.
  std::vector<std::unique_ptr<const std::string>> unquoted;
};

/// What stands between a table's fields: a comma; or a semicolon or a tab, if the first line has
/// these and no comma.
char separator_of(std::string_view text);

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

}  // namespace eventgan

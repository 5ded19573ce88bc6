#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace eventgan {

/// A table that grows row by row in a CSV file with fixed columns. Cells are numbers and plain
/// words: they have no commas. Not thread safe.
class CsvTable {
 public:
  using Row = std::vector<std::string>;

  /// Opens FILE, or begins it. Of the rows it has, those up to the first for which `keep` is false,
  /// or that is not whole (a run was killed while it wrote), stay; the rest is cut off. A file with
  /// other columns is begun again. Throws std::runtime_error naming the file.
  CsvTable(const std::filesystem::path& file, const Row& columns,
           const std::function<bool(const Row&)>& keep);

  /// The rows that were kept from before.
  const std::vector<Row>& kept() const { return kept_; }

  /// Adds a row of as many cells as columns. Throws std::runtime_error naming the file.
  void add(const Row& row);

  /// Hands what was added to the system.
  void flush();

 private:
  std::filesystem::path file_;
  std::vector<Row> kept_;
  std::ofstream stream_;
};

/// A number in six significant digits; empty for NaN.
std::string csv_number(double value);

/// The number of a cell; NaN if it is empty or no number.
double csv_value(const std::string& cell);

}  // namespace eventgan

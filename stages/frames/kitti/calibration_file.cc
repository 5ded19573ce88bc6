#include "stages/frames/kitti/detail/calibration_file.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"

namespace eventgan {

bool has_full_rank(std::span<const double> matrix) {
  constexpr double kLargest = 1e12, kSmallest = 1e-9;
  if (!std::ranges::all_of(matrix, [](double x) { return std::abs(x) <= kLargest; })) return false;
  std::array<std::array<double, 3>, 3> m{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = matrix.subspan(i * matrix.size() / 3, 3);
    const double scale = std::max({std::abs(row[0]), std::abs(row[1]), std::abs(row[2])});
    for (std::size_t j = 0; j < 3; ++j) m[i][j] = row[j] / scale;  // 0/0 is NaN
  }
  const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return std::abs(determinant) > kSmallest;
}

CalibrationFile::CalibrationFile(const SourceRoot& root, const std::string& relative)
    : text_(root.read_or_throw(relative)), path_(root.written(relative)) {}

std::vector<double> CalibrationFile::numbers(std::string_view key, std::size_t count) const {
  for (const TextLine& line : split_lines(text_)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty() || columns[0] != std::string(key) + ":") continue;
    const std::string where = "in " + place_in_file(path_, line.number);
    if (columns.size() != count + 1) {
      throw InputError("expected " + std::to_string(count) + " numbers for " + std::string(key) +
                       ", got " + std::to_string(columns.size() - 1) + ", " + where);
    }
    std::vector<double> values;
    for (std::size_t i = 1; i <= count; ++i) {
      const auto number = parse_number<double>(columns[i]);
      if (!number) {
        throw InputError("expected finite numbers for " + std::string(key) + ", got " +
                         in_quotes(columns[i]) + ", " + where);
      }
      values.push_back(*number);
    }
    constexpr std::size_t kMatrix = 9;  // 3 x 3; a projection is 3 x 4
    if (count >= kMatrix && !has_full_rank(values)) {
      throw InputError("expected a matrix of full rank for " + std::string(key) + ", got " +
                       in_quotes(line.bytes) + ", " + where);
    }
    return values;
  }
  throw InputError("expected a line " + std::string(key) + ", got none, in " + path_);
}

}  // namespace eventgan

#include "stages/frames/dataset/full_rank.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

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

}  // namespace eventgan

#pragma once

#include <span>

namespace eventgan {

/// Whether a matrix [3][N], N >= 3, tells places apart: its numbers are finite (and at most 1e12),
/// and its first three columns have full rank, to 1e-9 with each row's largest number as 1. One of
/// zeros or of equal rows does not: it projects everything onto one point or line, or nowhere.
bool has_full_rank(std::span<const double> matrix);

}  // namespace eventgan

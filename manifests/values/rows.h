#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>

namespace eventgan {

/// Whether row i of a table is the enumeration's value i, so that none stands twice or in another's
/// place.
template <class Row, std::size_t N>
consteval bool are_in_order(const std::array<Row, N>& rows) {
  for (std::size_t i = 0; i < N; ++i) {
    if (static_cast<std::size_t>(rows[i].value) != i) return false;
  }
  return true;
}

/// What belongs to a row of a table and is defined elsewhere.
template <class Kind, class Part>
struct PartOf {
  Kind value;
  const Part* part;
};

/// A table's parts, one for each of its rows. It compiles only if they stand in the rows' order.
template <class Part, class Row, std::size_t N>
consteval std::array<const Part*, N> parts_of(
    const std::array<Row, N>& rows, const PartOf<decltype(Row::value), Part> (&parts)[N]) {
  std::array<const Part*, N> ordered{};
  for (std::size_t i = 0; i < N; ++i) {
    if (parts[i].value != rows[i].value) throw std::logic_error("expected the rows' order");
    ordered[i] = parts[i].part;
  }
  return ordered;
}

}  // namespace eventgan

#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/files/csv_records.h"

namespace eventgan {

/// The place of each of `names` in a table's records by its header, `std::nullopt` of a column that
/// is absent. The first `required` must be there, all at most once, and no others; else a fault
/// "expected X, got Y".
Outcome<std::vector<std::optional<std::size_t>>> csv_columns(
    const CsvRecord& header, std::span<const std::string_view> names, std::size_t required);

}  // namespace eventgan

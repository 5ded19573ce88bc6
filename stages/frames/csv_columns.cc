#include "stages/frames/csv_columns.h"

#include <fmt/format.h>

#include <algorithm>

#include "manifests/documents/detail/json_text.h"

namespace eventgan {

Outcome<std::vector<std::optional<std::size_t>>> csv_columns(
    const CsvRecord& header, std::span<const std::string_view> names, std::size_t required) {
  std::vector<std::optional<std::size_t>> places(names.size());
  for (std::size_t i = 0; i < header.fields.size(); ++i) {
    const auto name = std::ranges::find(names, header.fields[i]);
    if (name == names.end() || places[static_cast<std::size_t>(name - names.begin())]) {
      return SampleFault{fmt::format("expected columns {}, each once, got \"{}\"",
                                     fmt::join(names, ", "), escape_controls(header.fields[i]))};
    }
    places[static_cast<std::size_t>(name - names.begin())] = i;
  }
  for (std::size_t i = 0; i < required; ++i) {
    if (!places[i]) return SampleFault{fmt::format("expected a column {}, got none", names[i])};
  }
  return places;
}

}  // namespace eventgan

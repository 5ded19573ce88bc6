#include "pipeline/verification/dataset_check.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <sstream>
#include <string_view>
#include <utility>

#include "pipeline/finalization/dataset_description.h"
#include "pipeline/finalization/dataset_parts.h"
#include "pipeline/finalization/dataset_views.h"
#include "pipeline/verification/fault_line.h"
#include "stages/files/sha256.h"
#include "stages/files/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kMendedBy[] = " (eventgan finalize writes both anew)";

/// A line of indented JSON as a part of a sentence.
std::string as_value(std::string_view line) {
  constexpr std::size_t kMostShown = 120;
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  if (line.ends_with(',')) line.remove_suffix(1);
  return std::string(line.substr(0, kMostShown));
}

/// "LINE of the first, got LINE of the second", where they begin to differ.
std::string first_difference(const std::string& expected, const std::string& got) {
  std::istringstream expected_lines(expected);
  std::istringstream got_lines(got);
  std::string expected_line;
  std::string got_line;
  int number = 0;
  do {
    ++number;
    if (!std::getline(expected_lines, expected_line)) expected_line = "its end";
    if (!std::getline(got_lines, got_line)) got_line = "its end";
  } while (expected_line == got_line && expected_lines && got_lines);
  return as_value(expected_line) + ", got " + as_value(got_line) + ", in line " +
         std::to_string(number);
}

}  // namespace

std::vector<std::string> dataset_faults(const fs::path& folder, FrozenOutline frozen,
                                        std::vector<ShardState> shards) {
  const fs::path description = folder / kDescriptionName;
  const fs::path view = folder / kViewName;
  const bool has_view = fs::exists(view);
  if (fs::exists(description) != has_view) {
    const auto& there = has_view ? view : description;
    const auto& missing = has_view ? description : view;
    return {there.string() + ": expected " + missing.filename().string() +
            " beside it, got no file" + kMendedBy};
  }
  if (!has_view) return {};
  try {
    const DatasetParts parts = read_dataset_parts(folder, std::move(frozen), std::move(shards));
    if (parts.done.empty()) {
      return {description.string() + ": expected committed shards beside it, got none" + kMendedBy};
    }
    for (const ShardState& shard : parts.done) {
      const bool is_known = shard.outline.volume_size != ImageSize{};
      if (is_known && parts.headers.contains(shard.outline.source)) continue;
      return {description.string() +
              ": expected a sound shard of each source to compare it with, got damaged ones"};
    }
    const ViewReceipt receipt{sha256_of_file(view), static_cast<std::int64_t>(fs::file_size(view))};
    const std::string expected = describe_dataset(parts, views_of(parts), receipt);
    const std::string got = read_text_file(description);
    if (got == expected) return {};
    return {description.string() + ": expected what the markers and " + kViewName +
            " give: " + first_difference(expected, got) + kMendedBy};
  } catch (const std::exception& error) {
    return {description.string() + ": expected what the markers and " + kViewName +
            " give, got neither: " + fault_line(error)};
  }
}

}  // namespace eventgan

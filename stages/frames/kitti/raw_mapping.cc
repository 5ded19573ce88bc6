#include "stages/frames/kitti/raw_mapping.h"

#include <algorithm>

#include "manifests/faults.h"
#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

std::vector<RawFrame> parse_lines(std::string_view text, const std::string& path) {
  std::vector<RawFrame> frames;
  for (const TextLine& line : split_lines(text)) {
    const auto columns = split_columns(line.bytes);
    const auto number = columns.size() == 3 ? parse_number<std::int64_t>(columns[2]) : std::nullopt;
    if (!number || *number < 0) {
      throw InputError("expected DATE DRIVE FRAME, got " + in_quotes(line.bytes) + ", in " +
                       place_in_file(path, line.number));
    }
    frames.push_back({std::string(columns[0]), std::string(columns[1]), *number});
  }
  return frames;
}

}  // namespace

RawMapping::RawMapping(std::string_view rand, const std::string& rand_path,
                       std::string_view mapping, const std::string& mapping_path) {
  const std::vector<RawFrame> lines = parse_lines(mapping, mapping_path);
  std::string numbers(rand);
  std::ranges::replace(numbers, ',', ' ');
  for (const std::string_view token : split_columns(numbers)) {
    const auto line = parse_number<std::int64_t>(token);
    if (!line || *line < 1 || *line > static_cast<std::int64_t>(lines.size())) {
      throw InputError("expected line numbers from 1 to " + std::to_string(lines.size()) +
                       ", got " + in_quotes(token) + ", in " + rand_path);
    }
    frames_.push_back(lines[static_cast<std::size_t>(*line - 1)]);
  }
}

std::optional<RawFrame> RawMapping::find(std::int64_t object_number) const {
  if (object_number < 0 || object_number >= static_cast<std::int64_t>(frames_.size())) {
    return std::nullopt;
  }
  return frames_[static_cast<std::size_t>(object_number)];
}

}  // namespace eventgan

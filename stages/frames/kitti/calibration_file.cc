#include "stages/frames/kitti/detail/calibration_file.h"

#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/dataset/full_rank.h"

namespace eventgan {

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

#include <algorithm>
#include <array>

#include "pipeline/exports/detail/dataset_card.h"
#include "pipeline/exports/export_job.h"

namespace eventgan {

// The table of formats. Each row is in the file of its exporter.
ExportFormat yolo_format();
ExportFormat yolo_seg_format();
ExportFormat coco_format();
ExportFormat mpii_format();
ExportFormat hpe_format();
ExportFormat davis_format();
ExportFormat webdataset_format();
ExportFormat events_format();
ExportFormat dsec_format();
ExportFormat rvt_format();
ExportFormat raw_format();
ExportFormat aedat4_format();

const std::vector<ExportFormat>& export_formats() {
  static const std::vector<ExportFormat> kFormats = {
      yolo_format(), yolo_seg_format(), coco_format(),       mpii_format(),
      hpe_format(),  davis_format(),    webdataset_format(), events_format(),
      dsec_format(), rvt_format(),      raw_format(),        aedat4_format()};
  return kFormats;
}

namespace {

/// The word that `pattern` begins with; empty: none.
std::string_view leading_part(std::string_view pattern) {
  static constexpr std::array<std::string_view, 6> kAnyText{"SPLIT", "NAME",      "SET",
                                                            "SHARD", "RECORDING", "N"};
  const auto any = std::ranges::find_if(
      kAnyText, [&](std::string_view word) { return pattern.starts_with(word); });
  return any == kAnyText.end() ? std::string_view() : *any;
}

}  // namespace

bool fits(std::string_view name, std::string_view pattern, std::string_view split) {
  if (pattern.empty()) return name.empty();
  if (pattern.front() == '[') {
    const std::size_t end = pattern.find(']');
    const std::string inner(pattern.substr(1, end - 1));
    const std::string_view rest = pattern.substr(end + 1);
    return fits(name, rest, split) || fits(name, inner + std::string(rest), split);
  }
  const std::string_view any = leading_part(pattern);
  if (any.empty()) {
    return !name.empty() && name.front() == pattern.front() &&
           fits(name.substr(1), pattern.substr(1), split);
  }
  if (any == "SPLIT" && !split.empty()) {
    return name.starts_with(split) &&
           fits(name.substr(split.size()), pattern.substr(any.size()), split);
  }
  const std::size_t most = std::min(name.find('/'), name.size());
  for (std::size_t length = 1; length <= most; ++length) {
    if (fits(name.substr(length), pattern.substr(any.size()), split)) return true;
  }
  return false;
}

std::string spelled(std::string_view pattern,
                    const std::function<std::string(std::string_view)>& any,
                    const std::function<std::string(char)>& text) {
  std::string result;
  while (!pattern.empty()) {
    const std::string_view part = leading_part(pattern);
    result += part.empty() ? text(pattern.front()) : any(part);
    pattern.remove_prefix(std::max<std::size_t>(part.size(), 1));
  }
  return result;
}

bool writes(const ExportFormat& format, std::string_view name) {
  return name == kCardName || name == kCroissantName ||
         std::ranges::any_of(format.files,
                             [&](const ExportFile& file) { return fits(name, file.name); });
}

}  // namespace eventgan

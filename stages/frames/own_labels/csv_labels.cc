#include "stages/frames/own_labels/detail/csv_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "manifests/documents/detail/json_text.h"
#include "stages/frames/csv_records.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/label_name.h"

namespace eventgan {
namespace {

enum { kImage, kClass, kLeft, kTop, kRight, kBottom, kTrack };
constexpr std::array<std::string_view, 7> kColumns = {"image", "class",  "left", "top",
                                                      "right", "bottom", "track"};
using Row = std::array<std::string_view, kColumns.size()>;

std::string quoted(std::string_view text) { return '"' + escape_controls(text) + '"'; }

SampleFault expected(const std::string& what, const std::string& got) {
  return {"expected " + what + ", got " + got};
}

Outcome<NamedBox> box_of(const Row& row) {
  NamedBox read;
  if (!is_label_name(row[kClass])) {
    return expected("a class without control characters", quoted(row[kClass]));
  }
  read.class_name = row[kClass];
  Rectangle& xyxy = read.box.xyxy;
  const std::array edges{&xyxy.left, &xyxy.top, &xyxy.right, &xyxy.bottom};
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto edge = parse_number<double>(row[kLeft + i]);
    if (!edge || std::abs(*edge) > kFarthest_px) {
      return expected(fmt::format("{} within {:g} pixels", kColumns[kLeft + i], kFarthest_px),
                      quoted(row[kLeft + i]));
    }
    *edges[i] = *edge;
  }
  if (xyxy.right <= xyxy.left || xyxy.bottom <= xyxy.top) {
    return expected(
        "left < right and top < bottom",
        fmt::format("{}, {}, {}, {}", row[kLeft], row[kTop], row[kRight], row[kBottom]));
  }
  if (!row[kTrack].empty()) {
    const auto track = parse_number<std::int64_t>(row[kTrack]);
    if (!track || *track < 0)
      return expected("a whole number from 0 as track", quoted(row[kTrack]));
    read.box.track_id = *track;
  }
  return read;
}

/// An image's rows, one after the other.
class ImageRows {
 public:
  /// Beside the rows before it.
  std::optional<SampleFault> add(const Row& row) {
    const bool is_alone = std::ranges::all_of(row.begin() + 1, row.end(),
                                              [](std::string_view field) { return field.empty(); });
    if (is_without_boxes_ || (is_alone && !labels_.boxes.empty())) {
      return expected("one row alone of an image without boxes", "another of it");
    }
    is_without_boxes_ = is_alone;
    if (is_alone) return std::nullopt;
    auto box = box_of(row);
    if (is_fault(box)) return std::get<SampleFault>(box);
    const std::int64_t track = std::get<NamedBox>(box).box.track_id;
    if (track >= 0 && !tracks_.insert(track).second) {
      return expected("each track once in an image", std::to_string(track) + " twice");
    }
    labels_.boxes.push_back(std::move(std::get<NamedBox>(box)));
    return std::nullopt;
  }

  ImageLabels& labels() { return labels_; }

 private:
  ImageLabels labels_;
  bool is_without_boxes_ = false;
  std::set<std::int64_t> tracks_;
};

}  // namespace

bool is_label_header(const CsvRecord& header) {
  return header.fault.empty() && !is_fault(csv_columns(header, kColumns, kTrack));
}

std::map<std::string, Outcome<ImageLabels>> parse_csv_labels(std::string_view text,
                                                             const std::string& path) {
  CsvReader reader(text);
  const auto next = [&] {
    std::optional<CsvRecord> record = reader.next();
    if (!record || record->fault.empty()) return record;
    throw InputError(record->fault + ", in " + place_in_file(path, record->line));
  };
  const std::optional<CsvRecord> header = next();
  if (!header) {
    throw InputError("expected a header line image,class,left,top,right,bottom, got none, in " +
                     path);
  }
  const auto columns = csv_columns(*header, kColumns, kTrack);
  if (is_fault(columns)) {
    throw InputError(std::get<SampleFault>(columns).reason + ", in " +
                     place_in_file(path, header->line));
  }
  const auto& places = std::get<0>(columns);
  std::map<std::string, Outcome<ImageRows>> images;
  while (const std::optional<CsvRecord> record = next()) {
    const std::string place = place_in_file(path, record->line);
    if (record->fields.size() != header->fields.size()) {
      throw InputError(fmt::format("expected {} fields, got {}, in {}", header->fields.size(),
                                   record->fields.size(), place));
    }
    Row row;
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (places[i]) row[i] = record->fields[*places[i]];
    }
    if (!is_label_name(row[kImage])) {
      throw InputError("expected an image without control characters, got " + quoted(row[kImage]) +
                       ", in " + place);
    }
    Outcome<ImageRows>& image = images[std::string(row[kImage])];
    if (is_fault(image)) continue;
    auto& rows = std::get<ImageRows>(image);
    rows.labels().original.append(record->bytes);
    if (const auto fault = rows.add(row)) image = SampleFault{fault->reason + ", in " + place};
  }
  std::map<std::string, Outcome<ImageLabels>> labels;
  for (auto& [name, rows] : images) {
    if (is_fault(rows)) {
      labels.emplace(name, std::get<SampleFault>(rows));
    } else {
      labels.emplace(name, std::move(std::get<ImageRows>(rows).labels()));
    }
  }
  return labels;
}

}  // namespace eventgan

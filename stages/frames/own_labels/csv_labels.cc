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

#include "stages/frames/csv_columns.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/label_name.h"
#include "stages/frames/own_labels/detail/find_labels.h"
#include "stages/frames/own_labels/detail/frame_names.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {
namespace {

enum { kImage, kClass, kLeft, kTop, kRight, kBottom, kTrack };
constexpr std::array<std::string_view, 7> kColumns = {"image", "class",  "left", "top",
                                                      "right", "bottom", "track"};
using Row = std::array<std::string_view, kColumns.size()>;

NamedBox box_of(const Row& row) {
  NamedBox read;
  if (!is_label_name(row[kClass])) {
    throw BadLabel("a class without control characters", in_quotes(row[kClass]));
  }
  read.class_name = row[kClass];
  Rectangle& xyxy = read.box.xyxy;
  const std::array edges{&xyxy.left, &xyxy.top, &xyxy.right, &xyxy.bottom};
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto edge = parse_number<double>(row[kLeft + i]);
    if (!edge || std::abs(*edge) > kFarthest_px) {
      throw BadLabel(fmt::format("{} within {:g} pixels", kColumns[kLeft + i], kFarthest_px),
                     in_quotes(row[kLeft + i]));
    }
    *edges[i] = *edge;
  }
  if (xyxy.right <= xyxy.left || xyxy.bottom <= xyxy.top) {
    throw BadLabel("left < right and top < bottom",
                   fmt::format("{}, {}, {}, {}", row[kLeft], row[kTop], row[kRight], row[kBottom]));
  }
  if (!row[kTrack].empty()) {
    const auto track = parse_number<std::int64_t>(row[kTrack]);
    if (!track || *track < 0)
      throw BadLabel("a whole number from 0 as track", in_quotes(row[kTrack]));
    read.box.track_id = *track;
  }
  return read;
}

/// An image's rows, one after the other.
class ImageRows {
 public:
  /// Beside the rows before it. Throws BadLabel.
  void add(const Row& row) {
    const bool is_alone = std::ranges::all_of(row.begin() + 1, row.end(),
                                              [](std::string_view field) { return field.empty(); });
    if (is_without_boxes_ || (is_alone && !labels_.boxes.empty())) {
      throw BadLabel("one row alone of an image without boxes", "another of it");
    }
    is_without_boxes_ = is_alone;
    if (is_alone) return;
    NamedBox box = box_of(row);
    const std::int64_t track = box.box.track_id;
    if (track >= 0 && !tracks_.insert(track).second) {
      throw BadLabel("each track once in an image", std::to_string(track) + " twice");
    }
    labels_.boxes.push_back(std::move(box));
  }

  ImageLabels& labels() { return labels_; }

 private:
  ImageLabels labels_;
  bool is_without_boxes_ = false;
  std::set<std::int64_t> tracks_;
};

}  // namespace

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
    throw InputError(columns.fault().reason + ", in " + place_in_file(path, header->line));
  }
  const auto& places = *columns;
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
      throw InputError("expected an image without control characters, got " +
                       in_quotes(row[kImage]) + ", in " + place);
    }
    Outcome<ImageRows>& image = images[std::string(row[kImage])];
    if (is_fault(image)) continue;
    auto& rows = *image;
    rows.labels().original.append(record->bytes);
    try {
      rows.add(row);
    } catch (const BadLabel& bad) {
      image = bad.in(place);
    }
  }
  std::map<std::string, Outcome<ImageLabels>> labels;
  for (auto& [name, rows] : images) {
    if (is_fault(rows)) {
      labels.emplace(name, rows.fault());
    } else {
      labels.emplace(name, std::move(rows->labels()));
    }
  }
  return labels;
}

namespace {

class CsvLabels : public ReadLabels {
 public:
  CsvLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : ReadLabels(std::move(labelled)), path_(spec.path) {
    by_key_ = parse_csv_labels(SourceRoot("", base).read_or_throw(path_), path_);
    annotation_files_.push_back(path_);
    ClassList classes;
    const FrameNames names(source());
    std::vector<std::string> of_several;
    for (const auto& [image, labels] : by_key_) {
      classes.add(labels);
      const FrameNames::Match match = names.find(image);
      if (match.frame == FrameNames::kSeveral) {
        of_several.push_back(image);
      } else if (match.frame == FrameNames::kNone) {
        give_absent(match.below_root, image);
      } else {
        give(match.frame, image);
      }
    }
    refuse_bare_names(of_several, path_);
    schema_.class_names = classes.names();
    note_without_label(path_);
  }

  std::string label_place(const std::string& label_key) const override {
    return path_ + "#" + label_key;
  }

 private:
  std::string path_;
};

/// Whether a table's first record has the columns that parse_csv_labels requires, and no others.
bool is_label_header(const CsvRecord& header) {
  return header.fault.empty() && !is_fault(csv_columns(header, kColumns, kTrack));
}

std::optional<std::filesystem::path> find_csv(const FoundFrames& frames,
                                              std::vector<std::string>& remarks) {
  std::optional<std::filesystem::path> found;
  for (const std::filesystem::path& folder : {frames.root, frames.root.parent_path()}) {
    for (const std::filesystem::path& file : frames.files->in(folder, ".csv")) {
      const std::string text = beginning_of(file);
      CsvReader reader(text);
      const std::optional<CsvRecord> header = reader.next();
      if (!header) continue;
      const auto place = [&](std::string_view name) {
        return static_cast<std::size_t>(std::ranges::find(header->fields, name) -
                                        header->fields.begin());
      };
      const auto is_absent = [&](std::string_view name) {
        return place(name) == header->fields.size();
      };
      if (std::ranges::any_of(std::array{"image", "class", "left", "top", "right", "bottom"},
                              is_absent)) {
        continue;
      }
      bool any_of_frames = false;
      const std::size_t image = place("image");
      while (const std::optional<CsvRecord> row = any_of_frames ? std::nullopt : reader.next()) {
        any_of_frames = row->fields.size() > image && is_among(frames, row->fields[image]);
      }
      if (!any_of_frames) continue;
      if (!is_label_header(*header)) {
        remarks.push_back("a table with other columns left out: " + file.string());
      } else if (found) {
        remarks.push_back("another table of labels left out: " + file.string());
      } else {
        found = file;
      }
    }
  }
  return found;
}

}  // namespace

constinit const LabelReader kCsvReader{LabelFormat::kCsv, open_labels<CsvLabels>, find_csv};

}  // namespace eventgan

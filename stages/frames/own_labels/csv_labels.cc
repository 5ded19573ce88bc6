#include "stages/frames/own_labels/detail/csv_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/dataset/label_name.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"
#include "stages/frames/own_labels/label_readers.h"

namespace eventgan {
namespace {

enum { kImage, kClass, kLeft, kTop, kRight, kBottom, kWidth, kHeight, kTrack, kColumnCount };

/// A column by the names that tools give it, in small letters and without what stands between
/// words.
struct CsvColumn {
  std::string_view title;  ///< in messages
  std::array<std::string_view, 8> names;
};
constexpr std::array<CsvColumn, kColumnCount> kColumns = {{
    {"image", {"image", "filename", "file", "imagename", "imagepath", "path", "imageid", "frame"}},
    {"class", {"class", "label", "classname", "category", "name", "labelname", "object", "type"}},
    {"left", {"left", "x1", "xmin", "x", "bboxleft", "bbleft", "boxleft", "bboxx"}},
    {"top", {"top", "y1", "ymin", "y", "bboxtop", "bbtop", "boxtop", "bboxy"}},
    {"right", {"right", "x2", "xmax", "bboxright", "boxright"}},
    {"bottom", {"bottom", "y2", "ymax", "bboxbottom", "boxbottom"}},
    // The plain words last: beside a pair of the box's own they are the image's.
    {"width", {"w", "bboxwidth", "bbwidth", "boxwidth", "bboxw", "width"}},
    {"height", {"h", "bboxheight", "bbheight", "boxheight", "bboxh", "height"}},
    {"track", {"track", "trackid", "objectid", "tracknumber", "instanceid"}},
}};
/// Of a detector's results, which are no labels.
constexpr std::array<std::string_view, 6> kScores = {"score", "scores",      "confidence",
                                                     "conf",  "probability", "prob"};
using Row = std::array<std::string_view, kColumnCount>;

std::string plain_name(std::string_view header) {
  std::string name = in_small_letters(std::string(header));
  std::erase_if(name, [](char c) { return c == '_' || c == '-' || c == ' ' || c == '.'; });
  return name;
}

bool is_score(std::string_view header) {
  return std::ranges::find(kScores, plain_name(header)) != kScores.end();
}

/// The place of a header's field among the names of a column; their number if it is none of them.
std::size_t rank_in(std::size_t column, std::string_view header) {
  const auto& names = kColumns[column].names;
  const std::string name = plain_name(header);
  if (name.empty()) return names.size();
  return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
}

bool is_column(std::size_t column, std::string_view header) {
  return rank_in(column, header) < kColumns[column].names.size();
}

/// Where a table's columns are.
struct CsvColumns {
  std::array<std::optional<std::size_t>, kColumnCount> places;
  std::vector<std::string> unused;
  bool has_sides = false;  ///< width and height are a box's; else, if at all, the image's

  bool has(std::size_t column) const { return places[column].has_value(); }
};

/// The columns that a header names; a fault "expected X, got Y" where it is not one of boxes.
Outcome<CsvColumns> columns_of(const CsvRecord& header) {
  CsvColumns columns;
  std::string unknown;
  const auto refuse = [&](const std::string& got) {
    return SampleFault{
        "expected columns image, class, left, top, right, bottom (or width, height) "
        "and perhaps track, each once, got \"" +
        escape_controls(got) + "\""};
  };
  for (std::size_t i = 0; i < header.fields.size(); ++i) {
    const std::string name(header.fields[i]);
    if (is_score(name)) return refuse(name);
    std::size_t column = 0;
    while (column < kColumnCount && !is_column(column, name)) ++column;
    if (column == kColumnCount) {
      columns.unused.push_back(name);
      continue;
    }
    std::optional<std::size_t>& place = columns.places[column];
    const std::size_t rank = rank_in(column, name);
    const std::size_t other = place ? rank_in(column, header.fields[*place]) : rank + 1;
    if (rank == other) return refuse(name);
    if (rank < other) place = i;  // "image" counts before "frame"
  }
  columns.has_sides =
      !columns.has(kRight) && !columns.has(kBottom) && columns.has(kWidth) && columns.has(kHeight);
  if (columns.has_sides) {  // of which one may be the image's
    const std::string_view width = header.fields[*columns.places[kWidth]];
    const std::string_view height = header.fields[*columns.places[kHeight]];
    if (rank_in(kWidth, width) != rank_in(kHeight, height)) return refuse(std::string(width));
  }
  for (std::size_t i = 0; i <= kBottom; ++i) {
    if (columns.has(i) || (i >= kRight && columns.has_sides)) continue;
    if (!columns.unused.empty()) return refuse(columns.unused.front());
    return SampleFault{"expected a column " + std::string(kColumns[i].title) + ", got none"};
  }
  return columns;
}

/// Programs of some countries write 1,5 between semicolons. Between commas "1,024" may be 1024, and
/// is none.
std::optional<double> edge_of(std::string_view field, char separator) {
  const std::size_t comma = field.find(',');
  if (comma == std::string_view::npos || separator == ',') return parse_number<double>(field);
  std::string number(field);
  number[comma] = '.';
  return parse_number<double>(number);
}

NamedBox box_of(const Row& row, bool has_sides, char separator) {
  NamedBox read;
  if (!is_label_name(row[kClass])) {
    throw BadLabel("a class without control characters", in_quotes(row[kClass]));
  }
  read.class_name = row[kClass];
  Rectangle& xyxy = read.box.xyxy;
  const std::array edges{&xyxy.left, &xyxy.top, &xyxy.right, &xyxy.bottom};
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const std::size_t column = kLeft + i + (has_sides && i >= 2 ? kWidth - kRight : 0);
    const auto edge = edge_of(row[column], separator);
    if (!edge || std::abs(*edge) > kFarthest_px) {
      throw BadLabel(fmt::format("{} as a number from -{:.0f} to {:.0f}", kColumns[column].title,
                                 kFarthest_px, kFarthest_px),
                     in_quotes(row[column]));
    }
    *edges[i] = *edge;
  }
  if (has_sides) {
    xyxy.right += xyxy.left;
    xyxy.bottom += xyxy.top;
  }
  if (xyxy.right < xyxy.left || xyxy.bottom < xyxy.top) {
    throw BadLabel(
        has_sides ? "a width and height above 0" : "left < right and top < bottom",
        fmt::format("{:g}, {:g}, {:g}, {:g}", xyxy.left, xyxy.top, xyxy.right, xyxy.bottom));
  }
  if (!row[kTrack].empty()) {
    const auto track = parse_whole(row[kTrack]);
    if (!track || *track < 0)
      throw BadLabel("a whole number from 0 as track", in_quotes(row[kTrack]));
    read.box.track_id = *track;
  }
  return read;
}

/// An image's rows, one after the other.
class ImageRows {
 public:
  /// Beside the rows before it, whose text lives as long as this. Throws BadLabel.
  void add(const Row& row, bool has_sides, char separator, const CsvRecord& record,
           const std::string& place) {
    const auto is_empty = [](std::string_view field) { return field.empty(); };
    const bool is_alone = std::all_of(row.begin() + kClass, row.begin() + kWidth, is_empty) &&
                          row[kTrack].empty() &&
                          (!has_sides || (row[kWidth].empty() && row[kHeight].empty()));
    if (is_without_boxes_ || (is_alone && !labels_.boxes.empty())) {
      throw BadLabel("one row alone of an image without boxes", "another of it");
    }
    is_without_boxes_ = is_alone;
    if (is_alone) return;
    NamedBox box = box_of(row, has_sides, separator);
    if (!lines_.insert(trimmed(record.bytes)).second) {
      box.again_at = place;
      labels_.boxes.push_back(std::move(box));
      return;
    }
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
  std::set<std::string_view> lines_;
};

}  // namespace

std::map<std::string, Outcome<ImageLabels>> parse_csv_labels(std::string_view text,
                                                             const std::string& path) {
  const char separator = separator_of(text);
  CsvReader reader(text, separator);
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
  const Outcome<CsvColumns> columns = columns_of(*header);
  if (is_fault(columns)) {
    throw InputError(columns.fault().reason + ", in " + place_in_file(path, header->line));
  }
  const auto& places = columns->places;
  const bool has_sides = columns->has_sides;
  double largest = 0, smallest = 0;
  bool any_fraction = false;
  std::size_t boxes = 0;
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
    try {
      // Some columns are not read, but all are kept.
      if (record->bytes.find('\0') != std::string::npos) {
        throw BadLabel("expected text, got a NUL in it");
      }
      rows.labels().original.append(record->bytes);
      rows.add(row, has_sides, separator, *record, place);
      if (rows.labels().boxes.empty()) continue;
      const Rectangle& box = rows.labels().boxes.back().box.xyxy;
      largest = std::max({largest, box.right, box.bottom});
      smallest = std::min({smallest, box.left, box.top});
      for (const double edge : {box.left, box.top, box.right, box.bottom}) {
        any_fraction = any_fraction || edge != std::floor(edge);
      }
      ++boxes;
    } catch (const BadLabel& bad) {
      image = bad.in(place);
    }
  }
  constexpr std::size_t kFewest = 3;
  constexpr double kTolerance = 0.01;  // of shares, as Ultralytics has it
  const bool are_shares = any_fraction && smallest >= -kTolerance && largest <= 1 + kTolerance;
  if (are_shares || (boxes >= kFewest && largest <= 1)) {
    throw InputError("expected edges in pixels, got shares of the image, 0..1, in " + path);
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
    std::vector<NamedLabel> named;
    for (const auto& [image, labels] : by_key_) {
      classes.add(labels);
      named.push_back({image, image});
    }
    give_named(named, path_);
    schema_.class_names = classes.names();
    note_without_label(path_);
  }

  std::string label_place(const std::string& label_key) const override {
    return path_ + "#" + label_key;
  }

 private:
  std::string path_;
};

/// What a table calls its images, each once.
std::vector<std::string> images_in(std::string_view table, std::size_t column) {
  CsvReader reader(table, separator_of(table));
  reader.next();
  std::set<std::string, std::less<>> images;
  while (const std::optional<CsvRecord> row = reader.next()) {
    if (row->fields.size() > column) images.emplace(row->fields[column]);
  }
  return {images.begin(), images.end()};
}

/// The same of a whole file; none if it cannot be read.
std::vector<std::string> all_images_in(const std::filesystem::path& file, std::size_t column) try {
  return images_in(InputFile(file).read_all(), column);
} catch (const std::exception&) {  // it is told when it is opened
  return {};
}

LabelSearch find_csv(const FoundFrames& frames) {
  constexpr std::size_t kBeginning = (1 << 16) - 3;  // beginning_of, without a byte order mark
  std::vector<ManyLabels> tables;
  std::vector<std::size_t> columns_of_images;  // of the tables
  std::vector<std::string> remarks;
  for (const std::filesystem::path& folder : folders_around(frames)) {
    for (const std::filesystem::path& file : frames.files->in(folder, ".csv")) {
      if (std::ranges::find(tables, file, &ManyLabels::path) != tables.end() ||
          frames.stems.contains(file.stem().string())) {
        continue;
      }
      const std::string text = beginning_of(file);
      CsvReader reader(text, separator_of(text));
      const std::optional<CsvRecord> header = reader.next();
      if (!header || !header->fault.empty()) continue;
      const auto place_of = [&](std::size_t column) {
        return std::ranges::find_if(
            header->fields, [&](std::string_view field) { return is_column(column, field); });
      };
      const auto none = header->fields.end();
      if (place_of(kImage) == none || place_of(kClass) == none || place_of(kLeft) == none ||
          place_of(kTop) == none) {
        continue;
      }
      const Outcome<CsvColumns> columns = columns_of(*header);
      const std::size_t place =
          is_fault(columns) ? static_cast<std::size_t>(place_of(kImage) - header->fields.begin())
                            : *columns->places[kImage];
      std::vector<std::string> images = images_in(text, place);
      const auto all = [&] { return all_images_in(file, place); };
      bool is_ours = count_among(frames, images) > 0;
      if (!is_ours && !is_fault(columns) &&
          text.size() >= kBeginning) {  // other images' may be first
        images = frames.files->table_images(file, all);
        is_ours = count_among(frames, images) > 0;
      }
      if (!is_ours) continue;
      if (is_fault(columns)) {
        remarks.push_back("a table left out, " + columns.fault().reason + ": " + file.string());
      } else {
        tables.push_back({file, std::move(images)});
        columns_of_images.push_back(place);
      }
    }
  }
  for (std::size_t i = 0; tables.size() > 1 && i < tables.size(); ++i) {
    ManyLabels& table = tables[i];
    table.images = frames.files->table_images(
        table.path, [&] { return all_images_in(table.path, columns_of_images[i]); });
  }
  LabelSearch search = take_files(frames, tables);
  search.remarks = std::move(remarks);
  return search;
}

}  // namespace

bool has_score_column(std::string_view text) {
  CsvReader reader(text, separator_of(text));
  const std::optional<CsvRecord> header = reader.next();
  return header && std::ranges::any_of(header->fields, is_score);
}

bool has_box_header(std::string_view text) {
  const std::optional<CsvRecord> header = CsvReader(text, separator_of(text)).next();
  return header && header->fault.empty() && !is_fault(columns_of(*header));
}

bool has_box_columns(std::string_view text) {
  const std::optional<CsvRecord> header = CsvReader(text, separator_of(text)).next();
  const auto has = [&](std::size_t column) {
    return std::ranges::any_of(header->fields,
                               [&](std::string_view field) { return is_column(column, field); });
  };
  return header && has(kImage) && has(kLeft) && has(kTop) &&
         ((has(kRight) && has(kBottom)) || (has(kWidth) && has(kHeight)));
}

constinit const LabelReader kCsvReader{LabelFormat::kCsv, open_labels<CsvLabels>, find_csv};

}  // namespace eventgan

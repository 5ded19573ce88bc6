#include "stages/frames/own_labels/detail/mot_labels.h"

#include <array>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "stages/frames/csv_records.h"
#include "stages/frames/kitti/kitti_label.h"

namespace eventgan {
namespace {

/// One of the numbers that MOT gives classes.
struct MotClass {
  std::string_view name;
  bool ignore = false;
};

constexpr std::array<MotClass, 13> kClasses = {{{"pedestrian"},
                                                {"person_on_vehicle", true},
                                                {"car"},
                                                {"bicycle"},
                                                {"motorbike"},
                                                {"non_motorized_vehicle"},
                                                {"static_person", true},
                                                {"distractor", true},
                                                {"occluder"},
                                                {"occluder_on_the_ground"},
                                                {"occluder_full"},
                                                {"reflection", true},
                                                {"crowd", true}}};

/// The first column that is not as it should be leaves as this.
struct BadColumn {
  std::string reason;  ///< "expected X, got Y"
};

template <class Number>
Number number(std::string_view column, const char* expected, Number least, Number most) {
  const auto value = parse_number<Number>(column);
  if (value && *value >= least && *value <= most) return *value;
  throw BadColumn{std::string("expected ") + expected + ", got " + in_quotes(column)};
}

NamedBox box_of(const std::vector<std::string>& columns) {
  enum { kFrame, kId, kLeft, kTop, kWidth, kHeight, kConf, kClass, kVisibility };
  constexpr std::size_t kOf2015 = 10;  // x, y, z in place of class and visibility
  if (columns.size() <= kConf || columns.size() > kOf2015) {
    throw BadColumn{"expected 7 to 10 columns, got " + std::to_string(columns.size())};
  }
  NamedBox read;
  Box& box = read.box;
  constexpr std::int64_t kMostId = std::int64_t{1} << 53;
  box.track_id = number<std::int64_t>(columns[kId], "an id from 1", 1, kMostId);
  const auto pixel = [&](std::size_t column, const char* expected) {
    return number(columns[column], expected, -kFarthest_px, kFarthest_px);
  };
  box.xyxy.left = pixel(kLeft, "a number of pixels for bb_left") - 1;
  box.xyxy.top = pixel(kTop, "a number of pixels for bb_top") - 1;
  const double width = pixel(kWidth, "a number of pixels for bb_width");
  const double height = pixel(kHeight, "a number of pixels for bb_height");
  box.xyxy.right = box.xyxy.left + width;
  box.xyxy.bottom = box.xyxy.top + height;
  if (!(box.xyxy.right > box.xyxy.left && box.xyxy.bottom > box.xyxy.top)) {
    throw BadColumn{"expected a box of a width and height above 0, got " + columns[kWidth] + " x " +
                    columns[kHeight]};
  }
  const bool counts = number(columns[kConf], "a conf from 0 to 1", 0.0, 1.0) > 0;
  MotClass mot = kClasses[0];
  if (columns.size() == kOf2015) {
    for (std::size_t i = kClass; i < kOf2015; ++i) {
      number(columns[i], "a finite number for x, y and z", std::numeric_limits<double>::lowest(),
             std::numeric_limits<double>::max());
    }
  } else if (columns.size() > kClass) {
    const auto most = static_cast<int>(kClasses.size());
    const int kind = number(columns[kClass], "a class from 1 to 13", 1, most);
    mot = kClasses[static_cast<std::size_t>(kind - 1)];
    if (columns.size() > kVisibility) {
      number(columns[kVisibility], "a visibility from 0 to 1", 0.0, 1.0);
    }
  }
  read.class_name = mot.name;
  box.ignore = !counts || mot.ignore;
  return read;
}

/// What stands in one section of an .ini file, key by key.
using Section = std::map<std::string_view, TextLine, std::less<>>;

Section read_section(std::string_view text, std::string_view name, const std::string& path) {
  const auto refuse = [&](const std::string& expected, const TextLine& line) {
    throw InputError("expected " + expected + ", got " + in_quotes(trimmed(line.bytes)) + ", in " +
                     place_in_file(path, line.number));
  };
  Section section;
  bool is_found = false;
  bool is_here = false;
  for (const TextLine& line : split_lines(text)) {
    const std::string_view content = trimmed(line.bytes);
    if (content.empty() || content.starts_with(';') || content.starts_with('#')) continue;
    if (content.starts_with('[')) {
      is_here = content == name;
      if (is_here && is_found) refuse(std::string(name) + " once", line);
      is_found |= is_here;
      continue;
    }
    if (!is_here) continue;
    const std::size_t sign = content.find('=');
    if (sign == std::string_view::npos) refuse("a line key=value", line);
    const TextLine value{trimmed(content.substr(sign + 1)), line.number};
    if (!section.emplace(trimmed(content.substr(0, sign)), value).second) {
      refuse("each key once", line);
    }
  }
  if (!is_found) throw InputError("expected " + std::string(name) + ", got none, in " + path);
  return section;
}

}  // namespace

MotSequence parse_mot_sequence(std::string_view text, const std::string& path) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  const Section section = read_section(text, "[Sequence]", path);
  const auto line = [&](const char* key) {
    const auto found = section.find(key);
    if (found != section.end() && !found->second.bytes.empty()) return found->second;
    throw InputError(std::string("expected a value of ") + key + ", got none, in " + path);
  };
  const auto value = [&]<class Number>(const char* key, Number least, Number most) {
    const TextLine found = line(key);
    try {
      return number(found.bytes, "a number above 0", least, most);
    } catch (const BadColumn& bad) {
      throw InputError(bad.reason + " for " + key + ", in " + place_in_file(path, found.number));
    }
  };
  constexpr int kMostSide = static_cast<int>(kFarthest_px);
  MotSequence sequence;
  sequence.frames_per_second = value("frameRate", 1e-6, 1e6);
  sequence.length = value("seqLength", std::int64_t{1}, kMaxKittiFrame);
  sequence.size = {value("imHeight", 1, kMostSide), value("imWidth", 1, kMostSide)};
  return sequence;
}

std::map<std::int64_t, Outcome<ImageLabels>> parse_mot_labels(std::string_view text,
                                                              const std::string& path) {
  std::map<std::int64_t, Outcome<ImageLabels>> frames;
  std::set<std::pair<std::int64_t, std::int64_t>> seen;  // frame and id
  CsvReader reader(text);
  while (const std::optional<CsvRecord> line = reader.next()) {
    const std::string place = place_in_file(path, line->line);
    if (!line->fault.empty()) throw InputError(line->fault + ", in " + place);
    const auto frame = parse_number<std::int64_t>(line->fields[0]);
    if (!frame || *frame < 1 || *frame > kMaxKittiFrame) {
      throw InputError("expected a frame number from 1, got " + in_quotes(line->fields[0]) +
                       ", in " + place);
    }
    Outcome<ImageLabels>& outcome = frames[*frame];
    if (is_fault(outcome)) continue;
    try {
      NamedBox box = box_of(line->fields);
      if (!seen.emplace(*frame, box.box.track_id).second) {
        throw BadColumn{"expected each id once in a frame, got " +
                        std::to_string(box.box.track_id) + " twice"};
      }
      auto& labels = std::get<ImageLabels>(outcome);
      labels.original.append(line->bytes);
      labels.boxes.push_back(std::move(box));
    } catch (const BadColumn& bad) {
      outcome = SampleFault{bad.reason + ", in " + place};
    }
  }
  return frames;
}

}  // namespace eventgan

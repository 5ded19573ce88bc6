#include "stages/frames/own_labels/detail/mot_labels.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "manifests/files/csv_records.h"
#include "manifests/files/sha256.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/own_labels/yolo_text.h"

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

/// VisDrone's, from 0 (VisDrone2018-MOT-toolkit, README).
constexpr std::array<MotClass, 12> kVisDroneClasses = {{{"ignored regions", true},
                                                        {"pedestrian"},
                                                        {"people"},
                                                        {"bicycle"},
                                                        {"car"},
                                                        {"van"},
                                                        {"truck"},
                                                        {"tricycle"},
                                                        {"awning-tricycle"},
                                                        {"bus"},
                                                        {"motor"},
                                                        {"others"}}};

enum {
  kMotFrame,
  kMotId,
  kMotLeft,
  kMotTop,
  kMotWidth,
  kMotHeight,
  kMotConf,
  kMotClass,
  kMotTruncation,
  kMotOcclusion,
  kMotMost
};

double number(std::string_view column, const char* expected, double least, double most) {
  const auto value = parse_number<double>(column);
  if (value && *value >= least && *value <= most) return *value;
  throw BadLabel(std::string("expected ") + expected + ", got " + in_quotes(column));
}

std::int64_t whole(std::string_view column, const std::string& expected, std::int64_t least,
                   std::int64_t most) {
  const auto value = parse_whole(column);
  if (value && *value >= least && *value <= most) return *value;
  throw BadLabel("expected " + expected + ", got " + in_quotes(column));
}

/// Which of `count` classes a column names, from 0.
std::size_t class_of(std::string_view column, int first, std::size_t count) {
  const std::int64_t last = first + static_cast<std::int64_t>(count) - 1;
  const std::string expected = fmt::format("a class from {} to {}", first, last);
  return static_cast<std::size_t>(whole(column, expected, first, last) - first);
}

/// Adds the box of a row to its frame.
void add_row(const std::vector<std::string_view>& columns, const MotForm& form,
             ImageLabels& labels) {
  if (columns.size() <= kMotConf || columns.size() > kMotMost) {
    throw BadLabel("expected 7 to 10 columns, got " + std::to_string(columns.size()));
  }
  const bool is_of_2015 = columns.size() == kMotMost && !columns.back().empty();
  NamedBox read;
  Box& box = read.box;
  constexpr std::int64_t kMostId = std::int64_t{1} << 53;
  box.track_id = whole(columns[kMotId], "an id from 0, or -1", -1, kMostId);
  if (box.track_id < 0) labels.remarks.push_back("id -1 taken for none");
  if (box.track_id == 0 && !form.is_visdrone) labels.remarks.push_back("id 0 taken as it is");
  const auto pixel = [&](std::size_t column, const char* expected) {
    return number(columns[column], expected, -kFarthest_px, kFarthest_px);
  };
  box.xyxy.left = pixel(kMotLeft, "a number of pixels for bb_left") - form.edges_from;
  box.xyxy.top = pixel(kMotTop, "a number of pixels for bb_top") - form.edges_from;
  box.xyxy.right = box.xyxy.left + pixel(kMotWidth, "a number of pixels for bb_width");
  box.xyxy.bottom = box.xyxy.top + pixel(kMotHeight, "a number of pixels for bb_height");
  const bool is_unknown = parse_number<double>(columns[kMotConf]) == -1;
  const double conf = is_unknown ? 1 : number(columns[kMotConf], "a conf from 0 to 1", 0, 1);
  if (is_unknown) labels.remarks.push_back("conf -1 taken for 1");
  MotClass mot = kClasses[0];
  if (form.is_visdrone) {
    mot = kVisDroneClasses[class_of(columns[kMotClass], 0, kVisDroneClasses.size())];
    box.truncation =
        static_cast<float>(whole(columns[kMotTruncation], "0 or 1 as truncation", 0, 1));
    box.occlusion = static_cast<int>(whole(columns[kMotOcclusion], "0, 1 or 2 as occlusion", 0, 2));
  } else if (!form.class_names.empty() && columns.size() > kMotClass) {
    mot = {form.class_names[class_of(columns[kMotClass], 1, form.class_names.size())]};
  } else if (columns.size() > kMotClass && !is_of_2015) {
    mot = kClasses[class_of(columns[kMotClass], 1, kClasses.size())];
  }
  read.class_name = mot.name;
  box.ignore = conf == 0 || mot.ignore;
  labels.boxes.push_back(std::move(read));
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
  const Section section = read_section(text, "[Sequence]", path);
  const auto value = [&](const char* key, double least, double most) -> std::optional<double> {
    const auto found = section.find(key);
    if (found == section.end() || found->second.bytes.empty()) return std::nullopt;
    const auto [bytes, line] = found->second;
    const auto number = parse_number<double>(bytes);
    const bool is_sound = number && *number >= least && *number <= most;
    if (is_sound && (least < 1 || *number == std::trunc(*number))) return number;
    throw InputError(fmt::format("expected a number above 0, got {} for {}, in {}",
                                 in_quotes(bytes), key, place_in_file(path, line)));
  };
  MotSequence sequence;
  sequence.frames_per_second = value("frameRate", 1e-6, 1e6);
  if (const auto length = value("seqLength", 1, kMaxFrameNumber)) {
    sequence.length = static_cast<std::int64_t>(*length);
  }
  const auto height = value("imHeight", 1, kFarthest_px), width = value("imWidth", 1, kFarthest_px);
  if (height && width) sequence.size = {static_cast<int>(*height), static_cast<int>(*width)};
  return sequence;
}

bool is_visdrone_table(std::string_view text) {
  CsvReader reader(text);
  bool has_class = false;
  while (const std::optional<CsvRecord> line = reader.next()) {
    if (!line->fault.empty() || line->fields.size() != kMotMost) return false;
    const auto is_up_to = [&](std::size_t column, std::int64_t most) {
      const auto value = parse_whole(line->fields[column]);
      return value && *value >= 0 && *value <= most;
    };
    if (!is_up_to(kMotClass, std::ssize(kVisDroneClasses) - 1) || !is_up_to(kMotTruncation, 1) ||
        !is_up_to(kMotOcclusion, 2)) {
      return false;
    }
    has_class = has_class || !is_up_to(kMotClass, 0);
  }
  return has_class;
}

std::map<std::int64_t, Outcome<ImageLabels>> parse_mot_labels(std::string_view text,
                                                              const MotForm& form,
                                                              const std::string& path) {
  std::map<std::int64_t, Outcome<ImageLabels>> frames;
  std::set<std::pair<std::int64_t, std::int64_t>> seen;  // frame and id
  CsvReader reader(text);
  while (const std::optional<CsvRecord> line = reader.next()) {
    const std::string place = place_in_file(path, line->line);
    if (!line->fault.empty()) throw InputError(line->fault + ", in " + place);
    const auto frame = parse_whole(line->fields[kMotFrame]);
    if (!frame || *frame < 1 || *frame > kMaxFrameNumber) {
      throw InputError("expected a frame number from 1, got " + in_quotes(line->fields[0]) +
                       ", in " + place);
    }
    Outcome<ImageLabels>& outcome = frames[*frame];
    if (is_fault(outcome)) continue;
    try {
      // Some columns are not read, but all are kept.
      if (line->bytes.find('\0') != std::string::npos) {
        throw BadLabel("expected text, got a NUL in it");
      }
      auto& labels = *outcome;
      labels.original.append(line->bytes);
      add_row(line->fields, form, labels);
      const std::int64_t id = labels.boxes.back().box.track_id;
      if (id >= 0 && !seen.emplace(*frame, id).second) {
        throw BadLabel("expected each id once in a frame, got " + std::to_string(id) + " twice");
      }
    } catch (const BadLabel& bad) {
      outcome = bad.in(place);
    }
  }
  return frames;
}

namespace {

class MotLabels : public ReadLabels {
 public:
  MotLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : ReadLabels(std::move(labelled)), root_(spec.path, base), edges_from_(spec.edges_from) {
    std::map<std::string, Frames> sequences;
    for (std::size_t i = 0; i < source().frames.size(); ++i) {
      const SourceFrame& frame = source().frames[i];
      sequences[frame.sequence].emplace(frame.number, i);
    }
    std::vector<std::string> without;
    const bool is_file = std::filesystem::is_regular_file(root_.on_disk(""));
    if (is_file && sequences.size() > 1) {
      throw InputError("expected a folder of sequences, since there are " +
                       std::to_string(sequences.size()) + ", got a file, in " + spec.path);
    }
    if (!is_file) root_.require_folder("");
    for (const auto& [sequence, frames] : sequences) {
      const std::optional<std::string> file = is_file ? "" : find_file(sequence);
      if (file) {
        read_sequence(sequence, *file, frames);
      } else {
        without.push_back(sequence);
      }
    }
    if (!without.empty()) {
      notes_.push_back(
          counted(without, "sequence", " without gt/gt.txt or gt.txt in " + root_.written("")));
    }
    note_forms();
    std::vector<std::string> unused;
    for (const std::string& name : is_file ? std::vector<std::string>() : root_.folders_in("")) {
      const bool is_other = name != "gt" && !sequences.contains(name);
      if (is_other && find_file(name)) unused.push_back(name);
    }
    if (!unused.empty()) {
      notes_.push_back(counted(unused, "sequence",
                               " of labels without images left out in " + root_.written("")));
    }
    schema_.class_names = classes_.names();
    std::ranges::sort(annotation_files_);
    const auto twice = std::unique(annotation_files_.begin(), annotation_files_.end());
    annotation_files_.erase(twice, annotation_files_.end());  // a labels.txt of several sequences
    note_without_label(root_.written(""));
  }

  std::string label_place(const std::string& label_key) const override {
    return label_key.starts_with('#') ? root_.written("") + label_key : root_.written(label_key);
  }

  std::optional<double> frames_per_second(const std::string& sequence) const override {
    const auto rate = rates_.find(sequence);
    return rate == rates_.end() ? std::nullopt : std::optional(rate->second);
  }

 private:
  using Frames = std::map<std::int64_t, std::size_t>;  ///< by FrameRef::index

  /// SEQUENCE/gt/gt.txt, SEQUENCE/gt.txt, SEQUENCE.txt; of the only one gt/gt.txt and gt.txt too.
  std::optional<std::string> find_file(const std::string& sequence) const {
    const std::string folder = sequence.empty() ? "" : sequence + "/";
    for (const std::string& name : {folder + "gt/gt.txt", folder + "gt.txt", sequence + ".txt"}) {
      if (root_.has_file(name)) return name;
    }
    return std::nullopt;
  }

  /// What a sequence's table has in its columns: labels.txt beside it tells, or its numbers.
  MotForm form_of(const std::string& file, const std::string& text) {
    MotForm form;
    const SourceRoot folder = root_.above(file);
    if (folder.has_file("labels.txt")) {
      const std::string path = folder.written("labels.txt");
      annotation_files_.push_back(path);
      form.class_names =
          parse_yolo_classes(folder.read_or_throw("labels.txt"), path).names.class_names;
      for (std::size_t i = 0; i < form.class_names.size(); ++i) {
        meanings_[fmt::format("class {} of {}", i + 1, root_.written(file))] = form.class_names[i];
      }
      form.edges_from = 0;
      with_names_.push_back(root_.written(file));
    } else if (is_visdrone_table(text)) {
      form.is_visdrone = true;
      // Its README does not tell. Ultralytics' VisDrone.yaml takes edges from 0, and VisDrone's own
      // evaluation (dropObjects.m) lifts those at 0 to MATLAB's 1.
      form.edges_from = 0;
      of_visdrone_.push_back(root_.written(file));
    }
    meanings_["classes of " + root_.written(file)] = form.is_visdrone ? "VisDrone's"
                                                     : form.class_names.empty()
                                                         ? "MOT's"
                                                         : "those of labels.txt";
    if (edges_from_) form.edges_from = *edges_from_;
    return form;
  }

  /// Tells what is read otherwise than MOTChallenge writes it, and copies of a sequence.
  void note_forms() {
    const auto note = [&](const std::vector<std::string>& files, const std::string& classes,
                          const std::string& writer) {
      if (files.empty()) return;
      const std::string edges = edges_from_ ? ""
                                            : ", with edges from 0 as " + writer +
                                                  " (or as \"edges_from\" in the manifest's "
                                                  "labels says)";
      notes_.push_back(counted(files, "file", " with " + classes + edges));
    };
    note(with_names_, "the classes of labels.txt", "CVAT writes them");
    note(of_visdrone_, "VisDrone's classes in column 8",
         "the programs that convert VisDrone take them");
    if (!copies_.empty()) {
      notes_.push_back(
          counted(copies_, "sequence",
                  " with the labels of another, as MOT17 has each three times (to take "
                  "each once, put those to take, or links to them, into a folder and "
                  "give that as root: else train and val may share images)"));
    }
    remarks_.move_to(notes_);
  }

  /// seqinfo.ini in the folder of gt.txt, or above it where that is named gt.
  std::optional<MotSequence> read_info(const std::string& file) {
    SourceRoot folder = root_.above(file);
    if (folder.name() == "gt") folder = folder.above();
    if (!folder.has_file("seqinfo.ini")) return std::nullopt;
    const std::string path = folder.written("seqinfo.ini");
    annotation_files_.push_back(path);
    return parse_mot_sequence(folder.read_or_throw("seqinfo.ini"), path);
  }

  /// Throws InputError if images whose names tell no number, and which are counted in their order
  /// for that, are not as many as the sequence: one that is missing would shift the labels of all
  /// behind it.
  void require_all(const Frames& frames, const std::optional<MotSequence>& info,
                   std::int64_t last_number, const std::string& path) const {
    if (source().is_video || source().frames[frames.begin()->second].is_numbered) return;
    const std::int64_t count = std::ssize(frames);
    const bool is_told = info && info->length;
    const std::int64_t length = is_told ? *info->length : last_number;
    if (is_told ? count == length : count >= length) return;
    const std::filesystem::path first(source().frames[frames.begin()->second].name);
    throw InputError(fmt::format(
        "expected numbered images, or all {} frames of {}, got {} without numbers, in {}", length,
        path, count, source().root.written(first.parent_path().generic_string())));
  }

  void read_sequence(const std::string& sequence, const std::string& file, const Frames& frames) {
    const std::string path = root_.written(file);
    annotation_files_.push_back(path);
    const std::optional<MotSequence> info = read_info(file);
    if (info && info->frames_per_second) rates_[sequence] = *info->frames_per_second;
    // MOT's first frame is 1: that of a video is 0, and so may that of images be.
    const bool from_0 = source().is_video || frames.begin()->first == 0;
    if (from_0 && !source().is_video) {
      notes_.push_back("frame 1 of " + path + " is " +
                       source().root.written(source().frames[frames.begin()->second].name));
    }
    const std::string text = root_.read_or_throw(file);
    const auto [first, is_new] = of_text_.emplace(sha256_hex(text), sequence);
    if (!is_new && !text.empty()) copies_.push_back(sequence + " (of " + first->second + ")");
    auto by_number = parse_mot_labels(text, form_of(file, text), path);
    if (from_0) require_all(frames, info, by_number.empty() ? 0 : by_number.rbegin()->first, path);
    for (auto& [number, labels] : by_number) {
      const std::string key = file + "#" + std::to_string(number);
      classes_.add(labels);
      if (!is_fault(labels)) {
        if (info) labels->size = info->size;
        remarks_.add(*labels, label_place(key));
      }
      by_key_.emplace(key, std::move(labels));
      const auto frame = frames.find(from_0 ? number - 1 : number);
      if (frame != frames.end()) {
        give(frame->second, key);
      } else {
        const SourceFrame& first_frame = source().frames[frames.begin()->second];
        const std::filesystem::path other(first_frame.name);
        const std::int64_t absent = from_0 ? number - 1 : number;
        const std::string name = first_frame.is_numbered && !source().is_video
                                     ? renumbered(other.filename().string(), absent)
                                     : fmt::format("{:06}{}", absent, other.extension().string());
        give_absent((other.parent_path() / name).generic_string(), key);
      }
    }
  }

  SourceRoot root_;
  std::optional<int> edges_from_;  ///< as the manifest says
  ClassList classes_;
  Remarks remarks_;
  std::map<std::string, double> rates_;
  std::map<std::string, std::string> of_text_;  ///< the first sequence of a table, by its SHA-256
  std::vector<std::string> with_names_, of_visdrone_, copies_;
};

/// Whether a text's first row is one of a gt.txt, as far as numbers and commas tell.
bool is_mot_table(const std::filesystem::path& file) {
  const std::string text = beginning_of(file);
  CsvReader reader(text);
  const std::optional<CsvRecord> row = reader.next();
  return row && row->fields.size() >= 7 && row->fields.size() <= 10 &&
         std::ranges::all_of(row->fields, [](std::string_view field) {
           return parse_number<double>(field).has_value();
         });
}

LabelSearch find_mot(const FoundFrames& frames) {
  const std::filesystem::path above = frames.root.parent_path();
  const bool has_images = !frames.stems.empty() && !frames.is_video;
  if (has_images && has_file(above / "gt/gt.txt") && frames.root.filename() == "img1") {
    return {{above}};
  }
  if (has_images && has_file(frames.root / "gt/gt.txt")) return {{frames.root}};
  std::vector<std::string> sequences = frames.folders;
  if (frames.is_video) sequences.assign(frames.stems.begin(), frames.stems.end());
  for (const std::filesystem::path& folder : {frames.root, above}) {
    for (const std::string& sequence : sequences) {
      for (const char* name : {"gt/gt.txt", "gt.txt"}) {
        if (has_file(folder / sequence / name)) return {{folder}};
      }
      const std::filesystem::path beside = folder / (sequence + ".txt");
      if (has_file(beside) && is_mot_table(beside)) return {{folder}};
    }
  }
  return {};
}

}  // namespace

constinit const LabelReader kMotReader{LabelFormat::kMot, open_labels<MotLabels>, find_mot,
                                       /*image_folder=*/"img1", /*extension=*/".txt"};

}  // namespace eventgan

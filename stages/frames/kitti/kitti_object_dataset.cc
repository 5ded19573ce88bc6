#include "stages/frames/kitti/kitti_object_dataset.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/kitti/detail/calibration_file.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/kitti/kitti_raw_dataset.h"
#include "stages/frames/kitti/raw_drive.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

using State = PairedFrame::State;

/// "_01" for the frame one before.
std::string previous_mark(int steps_back) { return "_0" + std::to_string(steps_back); }

}  // namespace

ObjectImages::ObjectImages(const SourceRoot& root) {
  root.require_folder("image_2");
  labelled_ = NumberedSequence::list(root.on_disk("image_2"));
  for (int k = 1; k <= kPrevious; ++k) {
    // A frame's number in prev_2 is the labelled image's; the mark counts as part of the
    // extension.
    std::vector<std::string> marked;
    for (const std::string_view extension : kImageExtensions) {
      marked.push_back(previous_mark(k).append(extension));
    }
    const NumberedSequence& listed = previous_[static_cast<std::size_t>(k - 1)] =
        NumberedSequence::list(root.on_disk("prev_2"), "", {marked.begin(), marked.end()});
    // The frames of one K are left out of the others' lists.
    std::vector<std::string> in_none = k == 1 ? listed.left_out() : std::vector<std::string>();
    std::ranges::set_intersection(previous_left_out_, listed.left_out(),
                                  std::back_inserter(in_none));
    previous_left_out_ = std::move(in_none);
  }
}

ObjectImages::Place ObjectImages::at(std::int64_t number, const std::string& stem,
                                     int steps) const {
  if (steps == 0) {
    const auto place = labelled_.find(number);
    if (place.state == State::kPresent) return {State::kPresent, "image_2/" + place.name};
    return {State::kMissing, "image_2/" + stem + ".png"};
  }
  const auto back = static_cast<std::size_t>(-steps);
  const auto place = previous_[back - 1].find(number);
  if (place.state == State::kPresent) return {State::kPresent, "prev_2/" + place.name};
  State state = State::kBeyond;
  for (std::size_t further = back; further < previous_.size(); ++further) {
    if (previous_[further].contains(number)) state = State::kMissing;
  }
  return {state, "prev_2/" + stem + previous_mark(-steps) + ".png"};
}

namespace {

constexpr std::string_view kRandFile = "mapping/train_rand.txt";
constexpr std::string_view kMappingFile = "mapping/train_mapping.txt";

RawMapping read_mapping(const SourceRoot& devkit) {
  return {devkit.read_or_throw(kRandFile), devkit.written(kRandFile),
          devkit.read_or_throw(kMappingFile), devkit.written(kMappingFile)};
}

/// Whether two image files show the same; nothing if one of them cannot be read. Raw frames and
/// object images are the same files as KITTI gives them out: pixels are compared only where
/// somebody has written one of them again.
std::optional<bool> same_image(const SourceRoot& base, const std::string& a, const std::string& b) {
  const auto bytes_a = base.read(a);
  const auto bytes_b = base.read(b);
  if (is_fault(bytes_a) || is_fault(bytes_b)) return std::nullopt;
  if (bytes_a == bytes_b) return true;
  try {
    const ColourFrame frame_a = decode_image_file(base.on_disk(a));
    const ColourFrame frame_b = decode_image_file(base.on_disk(b));
    return frame_a.size == frame_b.size && frame_a.bgr == frame_b.bgr;
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

class KittiObjectDataset : public Dataset {
 public:
  KittiObjectDataset(const SourceSpec& spec, const std::filesystem::path& base)
      : root_(spec.root, base), images_(root_) {
    root_.require_folder("label_2");
    const auto labels = NumberedSequence::list(root_.on_disk("label_2"), "", {".txt"});
    frames_.reserve(labels.frames().size());
    for (const auto& [number, name] : labels.frames()) add_frame(number, name);
    note_left_out(labels.left_out(), "label_2");
    note_left_out(images_.labelled().left_out(), "image_2");
    note_left_out(images_.previous_left_out(), "prev_2");
    if (spec.devkit) {
      const SourceRoot devkit(*spec.devkit, base);
      std::optional<SourceRoot> raw;
      if (spec.raw_root) raw.emplace(*spec.raw_root, base);
      follow_mapping(devkit, raw);
      if (raw) check_mapping(SourceRoot("", base), devkit.written(kMappingFile));
    }
    std::ranges::sort(frames_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
    note(std::ranges::count_if(images_.labelled().frames(),
                               [&](const auto& frame) { return !labels.contains(frame.first); }),
         "image", " without labels in " + root_.written("image_2"));
  }

  const LabelSchema& label_schema() const override { return kitti_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }

  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    const std::int64_t index = frame.frame.index + steps;
    const RawDrive* drive = drive_of(frame);
    PairedFrame here;
    here.frame.index = index;
    here.frame.time_s =
        drive ? drive->time_s(index) : static_cast<double>(index) * kKittiFrameSeconds;
    if (steps <= 0 && steps >= -ObjectImages::kPrevious) {
      const auto place = images_.at(number_of(frame), frame.sample_id, steps);
      here.state = place.state;
      here.frame.path = root_.written(place.path);
    }
    if (here.state == State::kPresent || steps == 0 || drive == nullptr) return here;

    // prev_2 may know of a frame still further back where the drive does not: a missing frame all
    // the same.
    PairedFrame raw = drive->frame(index);
    if (raw.state == State::kBeyond && here.state == State::kMissing) return here;
    return raw;
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    auto text = root_.read(label_key);
    if (is_fault(text)) return text.fault();
    auto annotation = parse_kitti_label(*std::move(text), label_place(label_key));
    const std::string calibration = calibration_of(label_key);
    if (is_fault(annotation) || !root_.has_file(calibration)) return annotation;
    try {
      annotation->projection = CalibrationFile(root_, calibration).read<12>("P2");
    } catch (const InputError& error) {
      return SampleFault{error.what()};
    }
    return annotation;
  }

  std::string label_place(const std::string& label_key) const override {
    return root_.written(label_key);
  }

 private:
  void add_frame(std::int64_t number, const std::string& label_name) {
    LabelledFrame frame;
    frame.sample_id = label_name.substr(0, label_name.rfind('.'));
    frame.label_key = "label_2/" + label_name;
    annotation_files_.push_back(root_.written(frame.label_key));
    if (const std::string calibration = calibration_of(frame.label_key);
        root_.has_file(calibration)) {
      annotation_files_.push_back(root_.written(calibration));
    }
    const auto place = images_.at(number, frame.sample_id, 0);
    frame.frame = {root_.written(place.path), 0, -1, 0};
    frames_.push_back(std::move(frame));
  }

  /// "label_2/001497.txt" → "calib/001497.txt"
  static std::string calibration_of(const std::string& label_key) {
    return "calib" + label_key.substr(label_key.find('/'));
  }

  /// Without `raw` the drives' names and the frames' numbers alone.
  void follow_mapping(const SourceRoot& devkit, const std::optional<SourceRoot>& raw) {
    if (raw) raw->require_folder("");
    const RawMapping mapping = read_mapping(devkit);
    annotation_files_.push_back(devkit.written(kMappingFile));
    annotation_files_.push_back(devkit.written(kRandFile));
    std::int64_t unmapped = 0;
    std::int64_t without_drive = 0;
    for (LabelledFrame& frame : frames_) {
      const auto raw_frame = mapping.find(number_of(frame));
      if (!raw_frame) {
        ++unmapped;
        continue;
      }
      frame.sequence = raw_frame->drive;
      frame.frame.index = raw_frame->number;
      auto [place, is_new] = drives_.try_emplace(raw_frame->drive, std::nullopt);
      if (is_new && raw) {
        open_drive(*raw, raw_frame->date + "/" + raw_frame->drive, place->second);
      }
      if (!place->second) ++without_drive;
      frame.frame.time_s = place->second
                               ? place->second->time_s(raw_frame->number)
                               : static_cast<double>(raw_frame->number) * kKittiFrameSeconds;
    }
    note(unmapped, "labelled frame", " that " + devkit.written(kMappingFile) + " does not know");
    if (raw) {
      note(without_drive, "labelled frame", " whose raw drive is missing in " + raw->written(""));
    }
  }

  /// Tells the frames of drives that are at fault so. Another list than the devkit's leads
  /// every image elsewhere, so that one of a drive shows it; a list wrong in single places does
  /// not show unless the first of a drive is among them.
  void check_mapping(const SourceRoot& base, const std::string& mapping_path) {
    std::map<std::string, std::optional<std::string>> faults;  // by drive; empty: compared, equal
    for (const LabelledFrame& frame : frames_) {
      const RawDrive* drive = drive_of(frame);
      if (drive == nullptr) continue;
      std::optional<std::string>& fault = faults[frame.sequence];
      if (!fault && !drive->fault().empty()) fault = drive->fault();
      if (!fault) fault = contradiction(frame, *drive, base, mapping_path);
    }
    for (const auto& [drive, fault] : faults) {
      if (fault && !fault->empty()) {
        notes_.push_back("no frame of " + drive + " can be used: " + *fault);
      }
    }
    note(std::ranges::count_if(faults, [](const auto& drive) { return !drive.second; }), "drive",
         " of which no image could be compared with what " + mapping_path + " says");
    for (LabelledFrame& frame : frames_) {
      const auto found = faults.find(frame.sequence);
      if (found != faults.end()) frame.fault = found->second.value_or("");
      if (frame.fault.empty()) frame.fault = before_the_first(frame, mapping_path);
    }
  }

  /// Compares the frame's image or one before it with the drive's: what is wrong, "" if they are
  /// equal, nothing if there are no two to compare.
  std::optional<std::string> contradiction(const LabelledFrame& frame, const RawDrive& drive,
                                           const SourceRoot& base,
                                           const std::string& mapping_path) const {
    for (int steps = 0; steps >= -ObjectImages::kPrevious; --steps) {
      const auto place = images_.at(number_of(frame), frame.sample_id, steps);
      const PairedFrame raw = drive.frame(frame.frame.index + steps);
      if (place.state != State::kPresent || raw.state != State::kPresent) continue;
      const std::string image = root_.written(place.path);
      const auto same = same_image(base, image, raw.frame.path);
      if (!same) continue;
      if (*same) return "";
      return "expected the image " + raw.frame.path + ", to which " + mapping_path +
             " leads, got another, in " + image;
    }
    return std::nullopt;
  }

  /// What is wrong if there is an image before the drive's frame 0; "" if there is none.
  std::string before_the_first(const LabelledFrame& frame, const std::string& mapping_path) const {
    if (frame.sequence.empty()) return "";  // not in the mapping: previous frames are -1, -2, -3
    for (int back = 1; back <= ObjectImages::kPrevious; ++back) {
      const auto place = images_.at(number_of(frame), frame.sample_id, -back);
      if (frame.frame.index >= back || place.state != State::kPresent) continue;
      return "expected no frame before number 0 of " + frame.sequence + ", got one " +
             std::to_string(back) + " before number " + std::to_string(frame.frame.index) +
             " (to which " + mapping_path + " leads), in " + root_.written(place.path);
    }
    return "";
  }

  void open_drive(const SourceRoot& raw, const std::string& folder,
                  std::optional<RawDrive>& drive) {
    RawDrive opened(raw, folder);
    if (opened.images().empty()) return;
    if (!opened.timestamps_path().empty()) annotation_files_.push_back(opened.timestamps_path());
    drive = std::move(opened);
  }

  /// Null if the frame's drive is not known or not there.
  const RawDrive* drive_of(const LabelledFrame& frame) const {
    const auto drive = drives_.find(frame.sequence);
    return drive != drives_.end() && drive->second ? &*drive->second : nullptr;
  }

  /// The sample_id is the label file's name without ".txt": digits.
  static std::int64_t number_of(const LabelledFrame& frame) {
    return parse_number<std::int64_t>(frame.sample_id).value();
  }

  void note(std::int64_t count, const std::string& noun, const std::string& rest) {
    if (count > 0) notes_.push_back(count_text(count, noun, rest));
  }

  void note_left_out(const std::vector<std::string>& names, const std::string& folder) {
    if (names.empty()) return;
    notes_.push_back(counted(names, "file", " left out in " + root_.written(folder)));
  }

  SourceRoot root_;
  ObjectImages images_;
  std::vector<LabelledFrame> frames_;
  std::map<std::string, std::optional<RawDrive>> drives_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_kitti_object_dataset(const SourceSpec& spec,
                                                   const std::filesystem::path& base) {
  if (spec.raw_root && !spec.devkit) {
    throw UsageError("kitti_object: expected devkit with raw_root, got raw_root alone");
  }
  return std::make_unique<KittiObjectDataset>(spec, base);
}

namespace {

bool is_kitti_object(const std::filesystem::path& root) { return has_folder(root / "label_2"); }

bool is_devkit(const std::filesystem::path& folder) {
  return has_file(folder / "mapping/train_mapping.txt");
}

/// The first that fits of the two folders above `root`, and of the folders in these.
template <class Fits>
std::optional<std::filesystem::path> find_beside(const std::filesystem::path& root, Fits fits) {
  for (const std::filesystem::path& above :
       {root.parent_path(), root.parent_path().parent_path()}) {
    if (fits(above)) return above;
    for (const std::string& name : look_into(above).folders) {
      if (fits(above / name)) return above / name;
    }
  }
  return std::nullopt;
}

std::vector<FoundSource> complete_kitti_object(FoundSource found) {
  found.devkit = find_beside(found.root, is_devkit);
  if (found.devkit) found.raw_root = find_beside(found.root, is_kitti_raw);
  if (!has_folder(found.root / "prev_2")) {
    found.remarks.push_back("no prev_2: no previous frames from KITTI object itself");
  }
  if (!found.devkit) {
    found.remarks.push_back(
        "no devkit (a folder with mapping/train_mapping.txt): no gaps 4-6 through KITTI raw, no "
        "names of drives");
  } else if (!found.raw_root) {
    found.remarks.push_back("no raw_root (KITTI raw, DATE/DATE_drive_NNNN_sync): no gaps 4-6");
  }
  if (!has_folder(found.root / "calib")) found.remarks.push_back("no calib: no projections");
  return {std::move(found)};
}

constexpr std::array kKittiObjectLayouts{DatasetLayout{.fits = is_kitti_object,
                                                       .complete = complete_kitti_object,
                                                       .may_be_part =
                                                           [](std::string_view name) {
                                                             return name.starts_with("image") ||
                                                                    name.starts_with("prev_");
                                                           },
                                                       .image_folder = "image_2"}};

}  // namespace

constinit const DatasetReader kKittiObjectReader{.kind = DatasetKind::kKittiObject,
                                                 .open = open_kitti_object_dataset,
                                                 .origin = kitti_origin,
                                                 .layouts = kKittiObjectLayouts,
                                                 .habits = kKittiHabits};

}  // namespace eventgan

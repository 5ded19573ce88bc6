#include "stages/frames/kitti/kitti_raw_dataset.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/kitti/raw_drive.h"
#include "stages/frames/kitti/tracklets.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

constexpr char kTrackletFile[] = "/tracklet_labels.xml";

bool is_drive_of(const std::string& name, const std::string& date) {
  return name.starts_with(date + "_drive_") && name.ends_with("_sync");
}

struct Drive {
  RawDrive frames;
  std::optional<Tracklets> tracklets;
  const RawCalibration* calibration = nullptr;  ///< null if the date has none
  std::optional<SampleFault> unreadable;        ///< why the tracklets, which are there, are unknown
};

class KittiRawDataset : public Dataset {
 public:
  KittiRawDataset(const SourceSpec& spec, const std::filesystem::path& base)
      : root_(spec.root, base) {
    root_.require_folder("");
    std::vector<std::string> others;
    for (const std::string& date : root_.folders_in("")) {
      if (is_kitti_date(date)) {
        add_date(date);
      } else if (!date.starts_with('.')) {
        others.push_back(date);
      }
    }
    note(others, "folder", " without a date's name left out in ", "");
    if (drives_.empty()) {
      throw InputError("expected DATE/DATE_drive_NNNN_sync folders, got none, in " +
                       root_.written(""));
    }
    std::ranges::sort(frames_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return kitti_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }

  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    return drives_.at(frame.sequence).frames.paired_frame(frame.frame.index, steps);
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    // "DATE/DRIVE#FRAME"
    const std::size_t mark = std::min(label_key.rfind('#'), label_key.size());
    const auto drive =
        drives_.find(std::filesystem::path(label_key.substr(0, mark)).filename().string());
    const auto frame = parse_number<std::int64_t>(
        std::string_view(label_key).substr(std::min(mark + 1, label_key.size())));
    if (!frame || drive == drives_.end()) {
      return SampleFault{"expected DATE/DRIVE#FRAME, got " + in_quotes(label_key) + ", in " +
                         root_.written("")};
    }
    return annotate(drive->second, *frame);
  }

  std::string label_place(const std::string& label_key) const override {
    const std::size_t mark = std::min(label_key.rfind('#'), label_key.size());
    return root_.written(label_key.substr(0, mark) + kTrackletFile + label_key.substr(mark));
  }

 private:
  static Outcome<Annotation> annotate(const Drive& drive, std::int64_t number) {
    if (drive.unreadable) return *drive.unreadable;
    Annotation annotation;
    if (drive.calibration != nullptr) annotation.projection = drive.calibration->projection;
    if (!drive.tracklets) return annotation;
    auto outcome = drive.tracklets->frame(number);
    if (is_fault(outcome)) return outcome.fault();
    auto& frame = *outcome;
    annotation.original = std::move(frame.json);
    if (drive.calibration == nullptr) return annotation;
    for (const TrackletPose& pose : frame.poses) {
      if (const auto box = to_box(pose, *drive.calibration)) annotation.boxes.push_back(*box);
    }
    return annotation;
  }

  void add_date(const std::string& date) {
    std::vector<std::string> names = root_.folders_in(date);
    const auto others =
        std::stable_partition(names.begin(), names.end(),
                              [&](const std::string& name) { return is_drive_of(name, date); });
    note({others, names.end()}, "folder", " without a drive's name left out in ", date);
    names.erase(others, names.end());
    if (names.empty()) return;

    const RawCalibration* calibration = nullptr;
    if (auto read = read_raw_calibration(root_, date)) {
      calibration = &(calibrations_[date] = *read);
      for (const char* file : {"/calib_cam_to_cam.txt", "/calib_velo_to_cam.txt"}) {
        annotation_files_.push_back(root_.written(date + file));
      }
    }
    int with_tracklets = 0;
    for (const std::string& name : names) with_tracklets += add_drive(date, name, calibration);
    if (calibration == nullptr && with_tracklets > 0) {
      notes_.push_back(
          "no boxes from the tracklets of " + std::to_string(with_tracklets) +
          " drives, since calib_velo_to_cam.txt or calib_cam_to_cam.txt is missing in " +
          root_.written(date));
    }
  }

  /// True if the drive has tracklets.
  bool add_drive(const std::string& date, const std::string& name,
                 const RawCalibration* calibration) {
    const std::string folder = date + "/" + name;
    Drive drive{RawDrive(root_, folder), std::nullopt, calibration, std::nullopt};
    if (const auto& path = drive.frames.timestamps_path(); !path.empty()) {
      annotation_files_.push_back(path);
    }
    const std::string labels = folder + kTrackletFile;
    if (root_.has_file(labels)) {
      annotation_files_.push_back(root_.written(labels));
      auto xml = root_.read(labels);
      if (is_fault(xml)) {
        drive.unreadable = xml.fault();
      } else {
        drive.tracklets.emplace(*xml, root_.written(labels));
        note_labels_beyond_images(drive, root_.written(labels));
      }
    }
    for (const std::int64_t number : labelled_numbers(drive)) {
      LabelledFrame frame;
      frame.frame = drive.frames.frame(number).frame;
      frame.sample_id = name + "/" + std::filesystem::path(frame.frame.path).stem().string();
      frame.sequence = name;
      frame.label_key = folder + "#" + std::to_string(number);
      frame.fault = drive.frames.fault();
      frames_.push_back(std::move(frame));
    }
    if (!drive.frames.fault().empty()) {
      notes_.push_back("no frame of " + name + " can be used: " + drive.frames.fault());
    }
    note(drive.frames.images().left_out(), "file", " left out in ", folder + "/image_02/data");
    const bool has_tracklets = drive.tracklets.has_value();
    drives_.emplace(name, std::move(drive));
    return has_tracklets;
  }

  /// The frames with an image, and those with tracklets that lost theirs.
  static std::set<std::int64_t> labelled_numbers(const Drive& drive) {
    std::set<std::int64_t> numbers;
    for (const auto& [number, file] : drive.frames.images().frames()) numbers.insert(number);
    if (!drive.tracklets) return numbers;
    for (const std::int64_t number : drive.tracklets->frames()) {
      if (drive.frames.frame(number).state == PairedFrame::State::kMissing) numbers.insert(number);
    }
    return numbers;
  }

  void note_labels_beyond_images(const Drive& drive, const std::string& path) {
    const auto frames = drive.tracklets->frames();
    const auto beyond = std::ranges::count_if(frames, [&](std::int64_t frame) {
      return drive.frames.frame(frame).state == PairedFrame::State::kBeyond;
    });
    if (beyond == 0) return;
    notes_.push_back(count_text(beyond, "frame", " beyond the drive's images left out in " + path));
  }

  void note(const std::vector<std::string>& names, const std::string& noun, const std::string& rest,
            const std::string& folder) {
    if (!names.empty()) notes_.push_back(counted(names, noun, rest + root_.written(folder)));
  }

  SourceRoot root_;
  std::map<std::string, RawCalibration> calibrations_;  ///< by date
  std::map<std::string, Drive> drives_;                 ///< by name, which holds the date
  std::vector<LabelledFrame> frames_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_kitti_raw_dataset(const SourceSpec& spec,
                                                const std::filesystem::path& base) {
  return std::make_unique<KittiRawDataset>(spec, base);
}

namespace {

std::vector<FoundSource> complete_kitti_raw(FoundSource found) {
  const bool has_tracklets = any_folder(found.root, [&](const std::string& date) {
    return any_folder(found.root / date, [&](const std::string& drive) {
      return has_file(found.root / date / drive / "tracklet_labels.xml");
    });
  });
  if (!has_tracklets) found.remarks.push_back("no tracklet_labels.xml: no labels");
  return {std::move(found)};
}

constexpr std::array kKittiRawLayouts{DatasetLayout{
    .fits = is_kitti_raw, .complete = complete_kitti_raw, .may_be_part = [](std::string_view name) {
      return name.starts_with("image") || is_kitti_date(std::string(name));
    }}};

}  // namespace

bool is_kitti_raw(const std::filesystem::path& root) { return any_folder(root, is_kitti_date); }

constinit const DatasetReader kKittiRawReader{.kind = DatasetKind::kKittiRaw,
                                              .open = open_kitti_raw_dataset,
                                              .origin = kitti_origin,
                                              .layouts = kKittiRawLayouts,
                                              .habits = kKittiHabits};

}  // namespace eventgan

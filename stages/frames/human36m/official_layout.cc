#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "stages/base/archives/array_json.h"
#include "stages/base/archives/cdf_matrix.h"
#include "stages/frames/decoding/video_clip.h"
#include "stages/frames/human36m/derived_frame.h"
#include "stages/frames/human36m/detail/camera_book.h"
#include "stages/frames/human36m/detail/human36m_dataset.h"
#include "stages/frames/human36m/detail/pose_table.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

constexpr char kPoses[] = "Pose";
constexpr std::size_t kAllJoints = 32;

/// A file of poses, as far as they are taken.
struct PoseFile {
  TableColumns columns;         ///< "Pose" [taken, joint, coordinate]; row i: frame i `every` + 1
  std::size_t frame_count = 0;  ///< in the file
};

/// Throws InputError, also if the file has not so many `frames` (none: at least one).
PoseFile read_poses(const std::filesystem::path& file, const std::string& shown,
                    std::size_t coordinates, std::size_t every,
                    std::optional<std::size_t> frames = std::nullopt) try {
  const TableColumns whole({{kPoses, read_cdf_matrix(file, kPoses)}}, shown);
  const TypedArray& poses = whole.need(kPoses, {frames, kAllJoints * coordinates});
  const std::size_t width = poses.shape[1];
  TypedArray taken{{(poses.shape[0] + every - 1) / every, kAllJoints, coordinates}, {}};
  std::visit(
      [&](const auto& values) {
        std::decay_t<decltype(values)> kept;
        for (std::size_t at = 0; at < values.size(); at += every * width) {
          const auto row = values.begin() + static_cast<std::ptrdiff_t>(at);
          kept.insert(kept.end(), row, row + static_cast<std::ptrdiff_t>(width));
        }
        taken.values = std::move(kept);
      },
      poses.values);
  return {TableColumns({{kPoses, std::move(taken)}}, shown), poses.shape[0]};
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

/// The files of one video's poses in memory, a row a frame of the video, of which those that are
/// taken can be asked for; see human36m_dataset.h.
class OfficialTable final : public PoseTable {
 public:
  OfficialTable(PoseFile poses, std::optional<PoseFile> poses_3d, const Human36mCamera* camera,
                std::size_t every)
      : poses_(std::move(poses)), poses_3d_(std::move(poses_3d)), every_(every) {
    if (camera == nullptr) return;
    camera_ = *camera;
    std::vector<double> errors_px;
    for (std::size_t row = 0; row < row_count(); row += every) {
      errors_px.push_back(projection_error_px(person(row)));
    }
    const std::string note =
        wrong_camera_note(errors_px, "cameras.pkl and D3_Positions_mono", poses_.columns.file());
    if (!note.empty()) notes_.push_back(note);
  }

  std::size_t row_count() const override { return poses_.frame_count; }
  std::size_t joint_count() const override { return kAllJoints; }
  std::vector<std::string> notes() const override { return notes_; }

  Outcome<Annotation> annotation(std::size_t row) const override {
    if (row % every_ != 0) {
      return SampleFault{"expected a frame of every " + std::to_string(every_) + ", got row " +
                         std::to_string(row) + ", in " + poses_.columns.file()};
    }
    nlohmann::ordered_json original;
    for (const auto& [name, file] : {std::pair("D2_Positions", &poses_),
                                     {"D3_Positions_mono", poses_3d_ ? &*poses_3d_ : nullptr}}) {
      if (file == nullptr) continue;
      if (auto fault = file->columns.not_finite(values(*file, row), kPoses, row)) return *fault;
      original[name] = to_json(file->columns.arrays().at(kPoses), row / every_);
    }
    if (camera_) original["cameras.pkl"] = camera_->fields;
    Annotation annotation;
    take_wrong_camera(annotation.persons.emplace_back(person(row)));
    annotation.original = dump_json(original);
    return annotation;
  }

 private:
  std::vector<double> values(const PoseFile& file, std::size_t row) const {
    return file.columns.row_of(kPoses, row / every_);
  }

  Person person(std::size_t row) const {
    Person person = person_of_joints(values(poses_, row),
                                     poses_3d_ ? values(*poses_3d_, row) : std::vector<double>());
    if (camera_) {
      person.camera = camera_->intrinsics;
      person.distortion = camera_->distortion;
    }
    return person;
  }

  PoseFile poses_;
  std::optional<PoseFile> poses_3d_;
  std::optional<Human36mCamera> camera_;
  std::size_t every_;
  std::vector<std::string> notes_;
};

/// Frames of a video, of which each `every`th is taken, from the first on.
class VideoFrames final : public TakenFrames {
 public:
  VideoFrames(std::string path, std::int64_t frame_count, std::int64_t every)
      : path_(std::move(path)), frame_count_(frame_count), every_(every) {}

  FrameRef frame(std::int64_t number) const override {
    return {.path = path_,
            .index = number,
            .video_frame = number - 1,
            .time_s = human36m_time_s(number)};
  }

  PairedFrame paired_frame(std::int64_t number, int steps) const override {
    const std::int64_t target = number + steps * every_;
    if (target < 1 || target > frame_count_) return {};
    return {PairedFrame::State::kPresent, frame(target)};
  }

 private:
  std::string path_;
  std::int64_t frame_count_;
  std::int64_t every_;
};

/// "Walking 1.54138969": what a take was called, and whose camera it is.
struct TakeName {
  std::string action;
  std::string camera;
};

/// None for other names, and for "_ALL.54138969", which is none of the dataset's activities.
std::optional<TakeName> parse_take_name(const std::string& stem) {
  const std::size_t dot = stem.rfind('.');
  if (dot == std::string::npos || dot == 0 || stem.front() == '_') return std::nullopt;
  TakeName name{stem.substr(0, dot), stem.substr(dot + 1)};
  if (name.camera.empty() || !std::ranges::all_of(name.camera, is_digit)) return std::nullopt;
  return name;
}

/// The files of a folder with that extension, without it.
std::set<std::string> stems_in(const SourceRoot& root, const std::string& folder,
                               const std::string& extension) {
  std::set<std::string> stems;
  for (const std::string& file : root.files_in(folder)) {
    if (file.ends_with(extension)) stems.insert(file.substr(0, file.size() - extension.size()));
  }
  return stems;
}

/// Opens the dataset, take by take, and keeps what is to be told of all of them together.
class OfficialLayout {
 public:
  OfficialLayout(const SourceSpec& spec, const std::filesystem::path& base)
      : root_(spec.root, base), every_(spec.every) {
    root_.require_folder("");
    cameras_ = dataset_->add_cameras(root_);
  }

  std::unique_ptr<Dataset> open() && {
    for (const std::string& subject : root_.folders_in("")) {
      if (subject.starts_with('S')) add_subject(subject);
    }
    const auto note = [this](const std::vector<std::string>& files, const char* noun,
                             const char* rest) {
      if (!files.empty()) dataset_->add_note(counted(files, noun, rest));
    };
    note(videos_alone_, "video", " without poses left out");
    note(poses_alone_, "file", " of poses without a video left out");
    note(unreadable_, "video", " whose samples will be quarantined");
    note(beyond_end_, "video", " with labelled frames beyond the end, left out");
    note(without_3d_, "video", " without joints in 3-D");
    if (!without_camera_.empty()) dataset_->add_note(no_intrinsics_note(without_camera_));
    if (dataset_->annotation_files().empty()) {
      throw InputError(
          "expected SUBJECT/Videos/ACTION.CAMERA.mp4 and "
          "SUBJECT/MyPoseFeatures/D2_Positions/ACTION.CAMERA.cdf files, got none, in " +
          root_.written(""));
    }
    dataset_->finish(root_.written(""));
    return std::move(dataset_);
  }

 private:
  void add_subject(const std::string& subject) {
    const std::set<std::string> videos = stems_in(root_, subject + "/Videos", ".mp4");
    const std::string poses_folder = subject + "/MyPoseFeatures/D2_Positions";
    const std::set<std::string> poses = stems_in(root_, poses_folder, ".cdf");
    for (const std::string& stem : videos) {
      const auto name = parse_take_name(stem);
      if (name && poses.contains(stem)) {
        add_take(subject, stem, *name);
      } else {
        videos_alone_.push_back(root_.written(subject + "/Videos/" + stem + ".mp4"));
      }
    }
    for (const std::string& stem : poses) {
      if (videos.contains(stem)) continue;
      poses_alone_.push_back(root_.written(poses_folder + "/" + stem + ".cdf"));
    }
  }

  void add_take(const std::string& subject, const std::string& stem, const TakeName& name) {
    const std::string video = subject + "/Videos/" + stem + ".mp4";
    const std::string features = subject + "/MyPoseFeatures/";
    const std::string key = features + "D2_Positions/" + stem + ".cdf";
    const std::string key_3d = features + "D3_Positions_mono/" + stem + ".cdf";
    const auto every = static_cast<std::size_t>(every_);

    PoseFile poses = read_poses(root_.on_disk(key), root_.written(key), 2, every);
    const auto rows = static_cast<std::int64_t>(poses.frame_count);
    std::optional<PoseFile> poses_3d;
    if (root_.has_file(key_3d)) {
      poses_3d =
          read_poses(root_.on_disk(key_3d), root_.written(key_3d), 3, every, poses.frame_count);
      dataset_->add_annotation_file(root_.written(key_3d));
    } else {
      without_3d_.push_back(root_.written(video));
    }
    const Human36mCamera* camera = find_camera(cameras_, subject, name.camera);
    if (camera == nullptr) without_camera_.insert(subject + " " + name.camera);

    const std::string sequence = subject + "/" + name.action + "/" + name.camera;
    std::string fault;
    const std::int64_t frames = frame_count(video, fault).value_or(rows);
    if (!fault.empty()) unreadable_.push_back(fault);
    dataset_->add_take(sequence,
                       std::make_unique<VideoFrames>(root_.written(video), frames, every_));
    std::int64_t beyond = 0;
    for (std::int64_t row = 0; row < rows; row += every_) {
      if (row >= frames) {
        ++beyond;
        continue;
      }
      dataset_->add_labelled(fmt::format("{}/{:06}", sequence, row + 1), sequence, row + 1, key,
                             static_cast<std::size_t>(row), fault);
    }
    if (beyond > 0) {
      beyond_end_.push_back(fmt::format("{} of {} ({} poses, {} frames)", beyond,
                                        root_.written(video), rows, frames));
    }
    dataset_->add_table(
        key, root_.written(key),
        std::make_unique<OfficialTable>(std::move(poses), std::move(poses_3d), camera, every));
  }

  /// How many frames the video announces: an MP4 has a list of them all. None, and why, if it
  /// cannot be read or its frames are others than those of the poses.
  std::optional<std::int64_t> frame_count(const std::string& video, std::string& fault) const {
    constexpr double kTolerance = 0.01;  // a rate that is frames over duration is seldom exact
    const std::string place = ", in " + root_.written(video);
    try {
      const VideoClip clip = measure_video(root_.on_disk(video), /*enough=*/1);
      const double rate = clip.frames_per_second.value_or(0);
      if (std::abs(rate / kHuman36mFramesPerSecond - 1) > kTolerance) {
        fault = fmt::format("expected a video of {:g} frames a second, as its poses are, got {:g}",
                            kHuman36mFramesPerSecond, rate) +
                place;
      } else if (clip.announced_count < 1) {
        fault = "expected a video that says how many frames it has, got one that does not" + place;
      } else {
        return clip.announced_count;
      }
    } catch (const InputError& error) {
      fault = error.what();
    }
    return std::nullopt;
  }

  SourceRoot root_;
  std::int64_t every_;
  std::unique_ptr<IndexedDataset> dataset_ = std::make_unique<IndexedDataset>();
  CameraBook cameras_;
  std::vector<std::string> videos_alone_, poses_alone_, unreadable_, beyond_end_, without_3d_;
  std::set<std::string> without_camera_;  ///< "S1 54138969"
};

}  // namespace

std::unique_ptr<Dataset> open_human36m_official(const SourceSpec& spec,
                                                const std::filesystem::path& base) {
  return OfficialLayout(spec, base).open();
}

}  // namespace eventgan

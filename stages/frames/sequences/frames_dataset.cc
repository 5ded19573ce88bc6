#include "stages/frames/sequences/frames_dataset.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/json_text_internal.h"
#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/frames/sequences/picture_folder.h"
#include "stages/frames/sequences/video_clip.h"
#include "stages/frames/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

class PicturesDataset final : public Dataset {
 public:
  PicturesDataset(const SourceSpec& spec, const fs::path& base)
      : root_(spec.root, base), frames_per_second_(spec.frames_per_second) {
    PictureFolder top = list_picture_folder(root_.on_disk(""));
    const auto note = [this](std::size_t count, const std::string& what) {
      if (count == 0) return;
      notes_.push_back(std::to_string(count) + " " + what + " in " + root_.written(""));
    };
    if (!top.frames.empty()) {
      note(top.folders.size(), "folders beside the pictures left out");
      add_sequence("", std::move(top));
    } else {
      note_unused(top, "");
      std::size_t without_pictures = 0;
      for (const std::string& name : top.folders) {
        PictureFolder folder = list_picture_folder(root_.on_disk(name));
        if (folder.frames.empty()) ++without_pictures;
        add_sequence(name, std::move(folder));
      }
      note(without_pictures, "folders without pictures");
    }
    if (labelled_.empty()) {
      throw InputError("expected pictures or folders of pictures, got none, in " +
                       root_.on_disk("").string());
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(sidecars_);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return sidecars_; }
  std::vector<std::string> notes() const override { return notes_; }

  Neighbour neighbour(const LabelledFrame& labelled, int steps) const override {
    const auto sequence = sequences_.find(labelled.sequence);
    if (sequence == sequences_.end()) return {};
    const auto place = sequence->second.at(labelled.frame.index, steps);
    if (place.state == Neighbour::State::kBeyond) return {};
    return {place.state, frame(sequence->first, place.number, place.name)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    if (lower_extension(label_key) != ".json") return Annotation{};
    Outcome<std::string> text = root_.read(label_key);
    if (auto* fault = std::get_if<SampleFault>(&text)) return std::move(*fault);
    Annotation annotation{std::get<std::string>(std::move(text)), {}, {}};
    try {
      parse_json_data(annotation.original, label_place(label_key));
    } catch (const std::runtime_error& error) {
      return SampleFault{error.what()};
    }
    return annotation;
  }

  std::string label_place(const std::string& label_key) const override {
    return root_.written(label_key);
  }

 private:
  static std::string spelled(const fs::path& path) { return path.generic_string(); }

  FrameRef frame(const std::string& sequence, std::int64_t number, const std::string& name) const {
    FrameRef frame{root_.written(spelled(fs::path(sequence) / name)), number};
    if (frames_per_second_) frame.time_s = static_cast<double>(number) / *frames_per_second_;
    return frame;
  }

  /// Tells of the files in a folder that become neither frame nor label.
  void note_unused(const PictureFolder& folder, const std::string& sequence) {
    const std::string place = " in " + root_.written(sequence);
    std::set<std::string> stems;
    for (const auto& [number, name] : folder.frames.frames()) {
      stems.insert(fs::path(name).stem().string());
    }
    std::vector<std::string> alone;
    for (const auto& [stem, name] : folder.sidecars) {
      if (!stems.contains(stem)) alone.push_back(name);
    }
    if (!alone.empty()) notes_.push_back(counted(alone, "labels without a picture" + place));
    if (!sequence.empty() && !folder.folders.empty()) {
      notes_.push_back(counted(folder.folders, "folders left out" + place));
    }
    if (!folder.left_out.empty()) {
      notes_.push_back(counted(folder.left_out, "files left out" + place));
    }
  }

  void add_sequence(const std::string& sequence, PictureFolder folder) {
    note_unused(folder, sequence);
    for (const auto& [number, name] : folder.frames.frames()) {
      const fs::path below = fs::path(sequence) / name;
      LabelledFrame labelled;
      labelled.sample_id = spelled(below.parent_path() / below.stem());
      labelled.sequence = sequence;
      labelled.frame = frame(sequence, number, name);
      const auto sidecar = folder.sidecars.find(below.stem().string());
      const bool has_label = sidecar != folder.sidecars.end();
      labelled.label_key = spelled(has_label ? fs::path(sequence) / sidecar->second : below);
      if (has_label) sidecars_.push_back(root_.written(labelled.label_key));
      labelled_.push_back(std::move(labelled));
    }
    sequences_.emplace(sequence, std::move(folder.frames));
  }

  SourceRoot root_;
  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::map<std::string, NumberedSequence> sequences_;
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> sidecars_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_pictures_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<PicturesDataset>(spec, base);
}

std::optional<VideoLabels> read_video_labels(const std::filesystem::path& file,
                                             const std::string& video) {
  const auto refuse = [&](const std::string& expected, const std::string& got) {
    throw InputError("expected " + expected + ", got " + got + ", in " + file.string() +
                     " (taken as the labels of " + video + ")");
  };
  nlohmann::ordered_json labels;
  try {
    labels =
        parse_json_data(read_text_file(file), file.filename().string(), JsonComments::kPassedOver);
  } catch (const std::runtime_error& error) {
    refuse("a JSON object from frame number to label", "\"" + std::string(error.what()) + "\"");
  }
  if (!labels.is_object()) refuse("a JSON object from frame number to label", labels.type_name());
  if (const auto format = labels.find("format");
      format != labels.end() && *format == "eventgan-manifest") {
    return std::nullopt;
  }

  VideoLabels by_frame;
  for (const auto& [key, label] : labels.items()) {
    std::int64_t frame = -1;
    const char* const end = key.data() + key.size();
    const auto [stop, error] = std::from_chars(key.data(), end, frame);
    if (error != std::errc() || stop != end || frame < 0)
      refuse("a frame number", "\"" + key + "\"");
    if (!by_frame.emplace(frame, label.dump()).second) {
      refuse("each frame once", "frame " + std::to_string(frame) + " twice");
    }
  }
  return by_frame;
}

namespace {

class VideoDataset final : public Dataset {
 public:
  VideoDataset(const SourceSpec& spec, const fs::path& base)
      : path_(fs::path(spec.root).generic_string()), clip_(measure_video(base / spec.root)) {
    if (spec.frames_per_second) {
      clip_.frames_per_second = spec.frames_per_second;
      clip_.uneven_times_s.clear();
    }
    read_sidecar(base);
    const std::string stem = fs::path(spec.root).stem().string();
    // At least six digits, and one width for all: so the samples' order is that of the frames.
    const std::size_t width =
        std::max<std::size_t>(6, std::to_string(clip_.frame_count - 1).size());
    for (std::int64_t i = 0; i < clip_.frame_count; ++i) {
      const std::string key = labels_.contains(i) ? std::to_string(i) : std::string();
      labelled_.push_back({fmt::format("{}/{:0{}}", stem, i, width), stem, frame(i), key});
    }
    note_frames_that_do_not_decode();
    if (!clip_.times_ascend && !spec.frames_per_second) {
      notes_.push_back("the times of the frames do not ascend, their rate is taken instead, in " +
                       path_);
    }
    const auto first_beyond = labels_.lower_bound(clip_.frame_count);
    if (const auto count = std::distance(first_beyond, labels_.end()); count > 0) {
      notes_.push_back(std::to_string(count) + " labels for frames beyond the video's " +
                       std::to_string(clip_.frame_count) + " left out, in " + sidecar_);
    }
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> notes() const override { return notes_; }

  std::vector<std::string> annotation_files() const override {
    return sidecar_.empty() ? std::vector<std::string>() : std::vector{sidecar_};
  }

  Neighbour neighbour(const LabelledFrame& labelled, int steps) const override {
    const std::int64_t number = labelled.frame.index + steps;
    if (number < 0 || number >= clip_.frame_count) return {};
    return {Neighbour::State::kPresent, frame(number)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    if (label_key.empty()) return Annotation{};
    std::int64_t number = -1;
    std::from_chars(label_key.data(), label_key.data() + label_key.size(), number);
    const auto label = labels_.find(number);
    if (label == labels_.end()) {
      return SampleFault{"expected a label of frame " + label_key + ", got none, in " + sidecar_};
    }
    return Annotation{label->second, {}, {}};
  }

  std::string label_place(const std::string& label_key) const override {
    return label_key.empty() ? path_ : sidecar_ + "#" + label_key;
  }

 private:
  /// Of NAME.json and NAME.JSON beside the video, the first by name that is no manifest; the other
  /// is noted.
  void read_sidecar(const fs::path& base) {
    const fs::path video(path_);
    const fs::path folder = base / video.parent_path();
    for (const fs::path name : list_folder(folder.empty() ? "." : folder).files) {
      if (name.stem() != video.stem() || lower_extension(name) != ".json") continue;
      if (!sidecar_.empty()) {
        notes_.push_back("1 labels left out, since " + sidecar_ + " counts: " + name.string());
        continue;
      }
      auto labels = read_video_labels(folder / name, path_);
      if (!labels) continue;
      labels_ = std::move(*labels);
      sidecar_ = (video.parent_path() / name).generic_string();
    }
  }

  /// A file cut short plays without complaint as far as it goes.
  void note_frames_that_do_not_decode() {
    const std::int64_t missing = clip_.announced_count - clip_.frame_count;
    const std::int64_t tolerance = std::max<std::int64_t>(1, clip_.announced_count / 100);
    if (missing <= tolerance) return;
    notes_.push_back("only " + std::to_string(clip_.frame_count) + " of about " +
                     std::to_string(clip_.announced_count) +
                     " announced frames can be decoded: the file may be cut short, in " + path_);
  }

  FrameRef frame(std::int64_t number) const {
    return {path_, number, number, clip_.time_s(number)};
  }

  std::string path_;
  VideoClip clip_;
  LabelSchema schema_;
  std::string sidecar_;                         ///< empty if there is none
  std::map<std::int64_t, std::string> labels_;  ///< by frame
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> notes_;
};

}  // namespace

bool is_video_name(const fs::path& file) {
  constexpr std::array<std::string_view, 4> kVideos = {".mp4", ".avi", ".mov", ".mkv"};
  return std::ranges::find(kVideos, lower_extension(file)) != kVideos.end();
}

std::unique_ptr<Dataset> open_video_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<VideoDataset>(spec, base);
}

std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const std::filesystem::path root = base / spec.root;
  std::error_code error;
  const auto status = std::filesystem::status(root, error);
  if (std::filesystem::is_directory(status)) return open_pictures_dataset(spec, base);
  if (std::filesystem::is_regular_file(status) && is_video_name(root)) {
    return open_video_dataset(spec, base);
  }
  throw InputError(
      "expected a folder of pictures, a folder of such folders, or a video (mp4, avi, mov, mkv), "
      "got " +
      std::string(std::filesystem::exists(status) ? "something else" : "nothing") + ", in " +
      root.string());
}

}  // namespace eventgan

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

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/frames/sequences/image_folder.h"
#include "stages/frames/sequences/video_clip.h"
#include "stages/frames/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

class ImagesDataset final : public Dataset {
 public:
  ImagesDataset(const SourceSpec& spec, const fs::path& base)
      : root_(spec.root, base), frames_per_second_(spec.frames_per_second) {
    ImageFolder top = list_image_folder(root_.on_disk(""));
    const auto note = [this](std::size_t count, const std::string& what) {
      if (count == 0) return;
      notes_.push_back(std::to_string(count) + " " + what + " in " + root_.written(""));
    };
    if (!top.frames.empty()) {
      note(top.folders.size(), "folders beside the pictures left out");
      add_sequence("", std::move(top));
    } else {
      note_unused(top, "");
      std::size_t without_images = 0;
      for (const std::string& name : top.folders) {
        ImageFolder folder = list_image_folder(root_.on_disk(name));
        if (folder.frames.empty()) ++without_images;
        add_sequence(name, std::move(folder));
      }
      note(without_images, "folders without pictures");
    }
    if (labelled_.empty()) {
      throw InputError("expected images, folders of images, or videos, got none, in " +
                       root_.on_disk("").string());
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(sidecars_);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return sidecars_; }
  std::vector<std::string> notes() const override { return notes_; }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    const auto sequence = sequences_.find(labelled.sequence);
    if (sequence == sequences_.end()) return {};
    const auto place = sequence->second.at(labelled.frame.index, steps);
    if (place.state == PairedFrame::State::kBeyond) return {};
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
  void note_unused(const ImageFolder& folder, const std::string& sequence) {
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

  void add_sequence(const std::string& sequence, ImageFolder folder) {
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

std::unique_ptr<Dataset> open_images_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<ImagesDataset>(spec, base);
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

constexpr std::array<std::string_view, 4> kVideoExtensions = {".mp4", ".avi", ".mov", ".mkv"};

/// The place of the extension in kVideoExtensions; their number if it is none of them.
std::size_t video_rank(const fs::path& file) {
  return static_cast<std::size_t>(std::ranges::find(kVideoExtensions, lower_extension(file)) -
                                  kVideoExtensions.begin());
}

/// A video and its labels.
struct LabelledClip {
  std::string path;  ///< as FrameRef::path is written
  VideoClip video;
  std::string sidecar;  ///< written as `path`; empty if there is none
  VideoLabels labels;

  FrameRef frame(std::int64_t number) const { return {path, number, number, video.time_s(number)}; }
};

class VideosDataset final : public Dataset {
 public:
  VideosDataset(const SourceSpec& spec, const fs::path& base)
      : frames_per_second_(spec.frames_per_second) {
    const fs::path root(spec.root);
    const bool is_folder = fs::is_directory(base / root);
    const SourceRoot folder(is_folder ? spec.root : root.parent_path().generic_string(), base);
    const FolderListing listing = list_folder(folder.on_disk(""));
    std::map<std::string, std::vector<std::string>> labels;  // names of .json files by stem
    for (const fs::path name : listing.files) {
      if (lower_extension(name) == ".json") labels[name.stem().string()].push_back(name.string());
    }
    if (is_folder) {
      for (const auto& [stem, name] : choose_videos(listing, folder)) {
        if (auto video = measure(folder, name)) add_clip(folder, name, *video, labels[stem]);
      }
      if (clips_.empty()) throw InputError(unreadable_.front());
      if (!unreadable_.empty()) notes_.push_back(counted(unreadable_, "videos left out"));
    } else {
      const std::string name = root.filename().string();
      add_clip(folder, name, measure_video(folder.on_disk(name)), labels[root.stem().string()]);
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> notes() const override { return notes_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    const LabelledClip& clip = clips_.at(labelled.sequence);
    const std::int64_t number = labelled.frame.index + steps;
    if (number < 0 || number >= clip.video.frame_count) return {};
    return {PairedFrame::State::kPresent, clip.frame(number)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const auto [stem, number] = split_key(label_key);
    if (number.empty()) return Annotation{};
    std::int64_t frame = -1;
    std::from_chars(number.data(), number.data() + number.size(), frame);
    if (const auto clip = clips_.find(stem); clip != clips_.end()) {
      const auto label = clip->second.labels.find(frame);
      if (label != clip->second.labels.end()) return Annotation{label->second, {}, {}};
    }
    return SampleFault{"expected a label of frame " + number + ", got none, in " +
                       label_place(label_key)};
  }

  std::string label_place(const std::string& label_key) const override {
    const auto [stem, number] = split_key(label_key);
    const auto clip = clips_.find(stem);
    if (clip == clips_.end()) return stem;
    return number.empty() ? clip->second.path : clip->second.sidecar + "#" + number;
  }

 private:
  /// A label_key is "STEM/NUMBER", or "STEM/" of a frame without label.
  static std::pair<std::string, std::string> split_key(const std::string& label_key) {
    const std::size_t slash = std::min(label_key.find('/'), label_key.size());
    return {label_key.substr(0, slash), label_key.substr(std::min(slash + 1, label_key.size()))};
  }

  /// The videos of a folder by their names without extension, which name the samples. All else but
  /// their labels is noted.
  std::map<std::string, std::string> choose_videos(const FolderListing& listing,
                                                   const SourceRoot& folder) {
    std::map<std::string, std::string> videos;
    std::vector<std::string> left_out = listing.folders;
    for (const fs::path name : listing.files) {
      if (!is_video_name(name) || name.string().starts_with('.')) continue;
      const auto [video, is_new] = videos.try_emplace(name.stem().string(), name.string());
      if (is_new) continue;
      std::string other = name.string();
      if (video_rank(name) < video_rank(video->second)) video->second.swap(other);
      left_out.push_back(std::move(other));
    }
    for (const fs::path name : listing.files) {
      const bool is_label = lower_extension(name) == ".json" && videos.contains(name.stem());
      if (!is_video_name(name) && !is_label) left_out.push_back(name.string());
    }
    std::erase_if(left_out, [](const std::string& name) { return name.starts_with('.'); });
    std::ranges::sort(left_out);
    if (!left_out.empty()) {
      notes_.push_back(counted(left_out, "files and folders left out in " + folder.written("")));
    }
    return videos;
  }

  std::optional<VideoClip> measure(const SourceRoot& folder, const std::string& name) try {
    return measure_video(folder.on_disk(name));
  } catch (const InputError& error) {
    unreadable_.push_back(error.what());
    return std::nullopt;
  }

  void add_clip(const SourceRoot& folder, const std::string& name, VideoClip video,
                const std::vector<std::string>& label_files) {
    const std::string stem = fs::path(name).stem().string();
    LabelledClip& clip = clips_[stem];
    clip.path = folder.written(name);
    clip.video = std::move(video);
    if (frames_per_second_) {
      clip.video.frames_per_second = frames_per_second_;
      clip.video.uneven_times_s.clear();
    }
    read_labels(folder, label_files, clip);
    // At least six digits, and one width for all: so the samples' order is that of the frames.
    const std::int64_t count = clip.video.frame_count;
    const std::size_t width = std::max<std::size_t>(6, std::to_string(count - 1).size());
    for (std::int64_t i = 0; i < count; ++i) {
      const std::string number = clip.labels.contains(i) ? std::to_string(i) : std::string();
      labelled_.push_back(
          {fmt::format("{}/{:0{}}", stem, i, width), stem, clip.frame(i), stem + "/" + number});
    }
    note_clip(clip);
  }

  /// Of NAME.json and NAME.JSON beside the video, the first by name that is no manifest; the other
  /// is noted.
  void read_labels(const SourceRoot& folder, const std::vector<std::string>& files,
                   LabelledClip& clip) {
    for (const std::string& name : files) {
      if (!clip.sidecar.empty()) {
        notes_.push_back("1 labels left out, since " + clip.sidecar + " counts: " + name);
        continue;
      }
      auto labels = read_video_labels(folder.on_disk(name), clip.path);
      if (!labels) continue;
      clip.labels = std::move(*labels);
      clip.sidecar = folder.written(name);
      annotation_files_.push_back(clip.sidecar);
    }
  }

  void note_clip(const LabelledClip& clip) {
    const VideoClip& video = clip.video;
    // A file cut short plays without complaint as far as it goes.
    const std::int64_t missing = video.announced_count - video.frame_count;
    if (missing > std::max<std::int64_t>(1, video.announced_count / 100)) {
      notes_.push_back("only " + std::to_string(video.frame_count) + " of about " +
                       std::to_string(video.announced_count) +
                       " announced frames can be decoded: the file may be cut short, in " +
                       clip.path);
    }
    if (!video.times_ascend && !frames_per_second_) {
      notes_.push_back("the times of the frames do not ascend, their rate is taken instead, in " +
                       clip.path);
    }
    const auto first_beyond = clip.labels.lower_bound(video.frame_count);
    if (const auto count = std::distance(first_beyond, clip.labels.end()); count > 0) {
      notes_.push_back(std::to_string(count) + " labels for frames beyond the video's " +
                       std::to_string(video.frame_count) + " left out, in " + clip.sidecar);
    }
  }

  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::map<std::string, LabelledClip> clips_;  ///< by the file's name without extension
  std::vector<std::string> unreadable_;        ///< why, of the videos that are left out
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace

bool is_video_name(const fs::path& file) { return video_rank(file) < kVideoExtensions.size(); }

std::unique_ptr<Dataset> open_videos_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<VideosDataset>(spec, base);
}

std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const std::filesystem::path root = base / spec.root;
  std::error_code error;
  const auto status = std::filesystem::status(root, error);
  if (std::filesystem::is_directory(status)) {
    const ImageFolder top = list_image_folder(root);
    const bool has_videos = std::ranges::any_of(top.left_out, is_video_name);
    return top.frames.empty() && has_videos ? open_videos_dataset(spec, base)
                                            : open_images_dataset(spec, base);
  }
  if (std::filesystem::is_regular_file(status) && is_video_name(root)) {
    return open_videos_dataset(spec, base);
  }
  throw InputError(
      "expected a video (mp4, avi, mov, mkv), a folder of images, of such folders, or of "
      "videos, got " +
      std::string(std::filesystem::exists(status) ? "something else" : "nothing") + ", in " +
      root.string());
}

}  // namespace eventgan

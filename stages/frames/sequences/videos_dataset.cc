#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/video_clip.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/absent_frames.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/sequences/frames_dataset.h"

namespace eventgan {

namespace fs = std::filesystem;

std::optional<VideoLabels> read_video_labels(const std::filesystem::path& file,
                                             const std::string& video) {
  const auto refuse = [&](const std::string& expected, const std::string& got) {
    throw InputError("expected " + expected + ", got " + got + ", in " + file.string() +
                     " (taken as the labels of " + video + ")");
  };
  nlohmann::ordered_json labels;
  try {
    const std::string text = read_text_file(file);
    if (is_manifest(text)) return std::nullopt;
    labels = parse_json_data(text, file.filename().string(), JsonComments::kPassedOver);
  } catch (const std::runtime_error& error) {
    refuse("a JSON object from frame number to label", "\"" + std::string(error.what()) + "\"");
  }
  if (!labels.is_object()) refuse("a JSON object from frame number to label", labels.type_name());

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
      if (!spec.labels && lower_extension(name) == ".json")
        labels[name.stem().string()].push_back(name.string());
    }
    if (is_folder) {
      std::vector<std::string> left_out;
      for (const auto& [stem, name] : choose_videos(listing, labels, left_out)) {
        if (auto video = measure(folder, name)) add_clip(folder, name, *video, labels[stem]);
      }
      if (clips_.empty()) throw InputError(unreadable_.front());
      if (spec.labels) add_labelled(*spec.labels, base, folder);
      note_left_out(folder, std::move(left_out));
      if (!unreadable_.empty()) notes_.push_back(counted(unreadable_, "video", " left out"));
    } else {
      const std::string name = root.filename().string();
      add_clip(folder, name, measure_video(folder.on_disk(name)), labels[root.stem().string()]);
      if (spec.labels) add_labelled(*spec.labels, base, folder);
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return labels_ ? labels_->schema() : schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> notes() const override { return notes_; }
  std::vector<std::string> warnings() const override {
    return labels_ ? labels_->warnings() : std::vector<std::string>();
  }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::map<std::string, std::string> label_meanings() const override {
    return labels_ ? labels_->meanings() : std::map<std::string, std::string>();
  }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    if (labelled.frame.index == kAbsentFrame) return {PairedFrame::State::kMissing, labelled.frame};
    const LabelledClip& clip = clips_.at(labelled.sequence);
    const std::int64_t number = labelled.frame.index + steps;
    if (number < 0 || number >= clip.video.frame_count) return {};
    return {PairedFrame::State::kPresent, clip.frame(number)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    if (labels_) return labels_->annotation(label_key);
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
    if (labels_) return labels_->label_place(label_key);
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

  /// The videos of a folder by their names without extension, which name the samples. `left_out`:
  /// all else but their labels.
  static std::map<std::string, std::string> choose_videos(
      const FolderListing& listing, const std::map<std::string, std::vector<std::string>>& labels,
      std::vector<std::string>& left_out) {
    std::map<std::string, std::string> videos;
    left_out = listing.folders;
    left_out.insert(left_out.end(), listing.passed_over.begin(), listing.passed_over.end());
    for (const fs::path name : listing.files) {
      if (!is_video_name(name) || name.string().starts_with('.')) continue;
      const auto [video, is_new] = videos.try_emplace(name.stem().string(), name.string());
      if (is_new) continue;
      std::string other = name.string();
      if (video_rank(name) < video_rank(video->second)) video->second.swap(other);
      left_out.push_back(std::move(other));
    }
    for (const fs::path name : listing.files) {
      const bool is_label = lower_extension(name) == ".json" && labels.contains(name.stem()) &&
                            videos.contains(name.stem());
      if (!is_video_name(name) && !is_label) left_out.push_back(name.string());
    }
    return videos;
  }

  void note_left_out(const SourceRoot& folder, std::vector<std::string> names) {
    std::ranges::sort(annotation_files_);
    const auto is_label = [&](const std::string& path) {
      const auto below = std::ranges::lower_bound(annotation_files_, path + "/");
      return std::ranges::binary_search(annotation_files_, path) ||
             (below != annotation_files_.end() && below->starts_with(path + "/"));
    };
    std::erase_if(names, [&](const std::string& name) {
      return name.starts_with('.') || (labels_ && is_label(folder.written(name)));
    });
    if (names.empty()) return;
    std::ranges::sort(names);
    notes_.insert(notes_.begin(), counted(names, "entry", " left out in " + folder.written("")));
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

  /// Takes the frames that have labels, in place of all.
  void add_labelled(const LabelSpec& spec, const fs::path& base, const SourceRoot& folder) {
    LabelledSource source{folder, {}, /*is_video=*/true};
    std::vector<LabelledFrame> frames = std::exchange(labelled_, {});
    std::map<std::string, ImageSize> sizes;
    for (const auto& [stem, clip] : clips_) {
      const Outcome<ImageSize> size =
          probe_image_size(base / clip.path, ImageOrientation::kUpright);
      if (is_fault(size)) throw InputError(size.fault().reason);
      sizes[stem] = *size;
    }
    for (const LabelledFrame& frame : frames) {
      source.frames.push_back({frame.sequence + "/" + std::to_string(frame.frame.index),
                               frame.sequence, frame.frame.index, sizes.at(frame.sequence)});
    }
    labels_ = open_own_labels(spec, base, std::move(source));
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const FrameLabel& label = labels_->labels()[i];
      if (label.key.empty()) continue;
      frames[i].label_key = label.key;
      frames[i].fault = label.fault;
      labelled_.push_back(std::move(frames[i]));
    }
    add_absent_frames(*labels_, labelled_);
    annotation_files_ = labels_->annotation_files();
    std::ranges::copy(labels_->notes(), std::back_inserter(notes_));
  }

  /// Of NAME.json and NAME.JSON beside the video, the first by name that is no manifest; the other
  /// is noted.
  void read_labels(const SourceRoot& folder, const std::vector<std::string>& files,
                   LabelledClip& clip) {
    for (const std::string& name : files) {
      if (!clip.sidecar.empty()) {
        notes_.push_back("a file of labels left out, since " + clip.sidecar + " counts: " + name);
        continue;
      }
      auto labels = read_video_labels(folder.on_disk(name), clip.path);
      if (!labels) continue;
      clip.labels = std::move(*labels);
      clip.sidecar = folder.written(name);
      annotation_files_.push_back(clip.sidecar);
    }
  }

  /// Whether frames that come unevenly last as long as announced: their number is an estimate then.
  static bool is_played_out(const VideoClip& video) {
    const std::vector<double>& times_s = video.uneven_times_s;
    if (times_s.empty() || !video.frames_per_second) return false;
    double longest_s = 0;
    for (std::size_t i = 1; i < times_s.size(); ++i) {
      longest_s = std::max(longest_s, times_s[i] - times_s[i - 1]);
    }
    const double announced_s =
        static_cast<double>(video.announced_count) / *video.frames_per_second;
    return times_s.back() + longest_s >= 0.99 * announced_s;
  }

  void note_clip(const LabelledClip& clip) {
    const VideoClip& video = clip.video;
    // A file cut short plays without complaint as far as it goes.
    const std::int64_t missing = video.announced_count - video.frame_count;
    if (missing > std::max<std::int64_t>(1, video.announced_count / 100) && !is_played_out(video)) {
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
      notes_.push_back(count_text(count, "label", " for frames beyond the video's ") +
                       std::to_string(video.frame_count) + " left out, in " + clip.sidecar);
    }
  }

  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::unique_ptr<OwnLabels> labels_;          ///< null: none of a known form
  std::map<std::string, LabelledClip> clips_;  ///< by the file's name without extension
  std::vector<std::string> unreadable_;        ///< why, of the videos that are left out
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> annotation_files_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_videos_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<VideosDataset>(spec, base);
}

}  // namespace eventgan

#include "stages/frames/sequences/video_dataset.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/faults.h"
#include "stages/frames/folder_listing.h"
#include "stages/frames/sequences/lower_extension.h"
#include "stages/frames/sequences/video_clip.h"
#include "stages/frames/sequences/video_labels.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

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

}  // namespace eventgan

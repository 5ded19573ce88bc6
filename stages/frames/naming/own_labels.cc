#include "stages/frames/naming/own_labels.h"

#include <algorithm>
#include <set>
#include <utility>

#include "manifests/values/text.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/naming/frame_names.h"

namespace eventgan {

OwnLabels::OwnLabels(LabelledSource source)
    : source_(std::move(source)),
      labels_(source_.frames.size()),
      image_sizes_(std::make_unique<ImageSizes>()) {}

OwnLabels::~OwnLabels() = default;

void OwnLabels::give(std::size_t frame, const std::string& key) {
  FrameLabel& label = labels_.at(frame);
  frame_of_key_.emplace(key, frame);
  if (label.key.empty()) {
    label.key = key;
  } else if (label.fault.empty()) {
    label.fault = "expected one label of " + source_.root.written(source_.frames[frame].name) +
                  ", got two, in " + label_place(label.key) + " and " + label_place(key);
  }
}

void OwnLabels::give_absent(const std::string& name, const std::string& key) {
  absent_.push_back({name, key});
}

void OwnLabels::give_named(const std::vector<NamedLabel>& named, const std::string& labels_path) {
  FrameNames names(source_);
  std::vector<std::string> of_several;
  std::vector<AbsentFrame> absent, elsewhere;
  std::vector<std::pair<FrameNames::Match, const NamedLabel*>> near;
  std::set<std::string> dropped;
  bool any_exact = false;
  for (const NamedLabel& label : named) {
    const FrameNames::Match match = names.find(label.image);
    if (match.frame == FrameNames::kSeveral) {
      of_several.push_back(label.image);
    } else if (match.is_near) {
      near.emplace_back(match, &label);
      if (!match.dropped.empty()) dropped.insert(match.dropped);
    } else if (match.frame != FrameNames::kNone) {
      any_exact = true;
      give(match.frame, label.key);
    } else if (match.is_elsewhere) {
      elsewhere.push_back({label.image, label.key,
                           "expected an image below " + source_.root.written("") + ", got " +
                               label.image +
                               ", which lies elsewhere (\"root\" may be a folder "
                               "above), in " +
                               label_place(label.key)});
    } else {
      absent.push_back({match.below_root, label.key});
    }
  }
  // The first two that have the name.
  const auto both_text = [&](const std::string& name) {
    std::vector<std::string> both;
    for (const SourceFrame& frame : source_.frames) {
      if (both.size() < 2 && frame.name.ends_with("/" + name)) both.push_back(frame.name);
    }
    return both.empty() ? "" : " (" + some_of(both, 2) + ")";
  };
  if (!of_several.empty()) {
    throw InputError("expected images' paths below " + source_.root.written("") + ", got " +
                     counted(of_several, "bare name", " that several of its folders have") +
                     ", in " + labels_path + both_text(of_several.front()));
  }
  if (dropped.size() > 1 && !any_exact) {  // each may be another video with the same names
    throw InputError("expected images' paths below " + source_.root.written("") + ", got " +
                     counted({dropped.begin(), dropped.end()}, "folder", " that it has not") +
                     ", in " + labels_path);
  }
  std::vector<bool> is_named(labels_.size());
  for (std::size_t i = 0; i < labels_.size(); ++i) is_named[i] = !labels_[i].key.empty();
  std::vector<std::string> others;
  std::unordered_map<std::string, std::string> by_number;  // one of `others` by its sequence
  for (const auto& [match, label] : near) {
    // Another's, where the frame has its own name in the file, or others have their folders there.
    if (is_named[match.frame] || (any_exact && !match.dropped.empty())) {
      absent.push_back({label->image, label->key});
      continue;
    }
    give(match.frame, label->key);
    const SourceFrame& frame = source_.frames[match.frame];
    others.push_back(label->image + " for " + frame.name);
    const std::string bare = label->image.substr(label->image.rfind('/') + 1);
    if (std::ranges::all_of(bare, is_digit)) by_number.emplace(frame.sequence, others.back());
  }
  for (std::size_t i = 0; i < labels_.size(); ++i) {  // as where the file counts from 1
    const SourceFrame& frame = source_.frames[i];
    const auto other = by_number.find(frame.sequence);
    if (frame.number != 0 || !labels_[i].key.empty() || other == by_number.end()) continue;
    warnings_.push_back("images are named by their numbers in " + labels_path + " (" +
                        other->second + "), and " + frame.name +
                        " has no label: if the file counts from 1, all labels are one image late; "
                        "name the images by their file names then");
    break;
  }
  if (!others.empty()) {
    notes_.push_back(count_text(std::ssize(others), "image", " named otherwise in " + labels_path) +
                     ": " + some_of(others, 3));
  }
  warn_of_counts_from_1(absent, names, labels_path);
  constexpr std::size_t kMany = 10;
  if (absent.size() >= kMany && 4 * absent.size() > named.size()) {
    std::vector<std::string> left_out;
    for (const AbsentFrame& frame : absent) left_out.push_back(frame.name);
    notes_.push_back(std::to_string(absent.size()) + " of " +
                     count_text(std::ssize(named), "image") + " in " + labels_path +
                     " are not in " + source_.root.written("") +
                     ", and left out: " + some_of(left_out, 3));
    absent.clear();
  }
  for (auto* const frames : {&absent, &elsewhere}) {
    for (AbsentFrame& frame : *frames) absent_.push_back(std::move(frame));
  }
}

void OwnLabels::warn_of_counts_from_1(const std::vector<AbsentFrame>& absent, FrameNames& names,
                                      const std::string& labels_path) {
  if (!source_.is_video) return;
  struct Clip {
    std::int64_t count = 0, first = -1, last = -1;  ///< of labels the lowest and the highest number
  };
  std::map<std::string, Clip> clips;
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    Clip& clip = clips[source_.frames[i].sequence];
    ++clip.count;
    if (clip.first < 0 && !labels_[i].key.empty()) clip.first = source_.frames[i].number;
  }
  for (const AbsentFrame& frame : absent) {
    const std::size_t of_clip = names.find(first_frame_name(frame.name)).frame;
    if (of_clip >= labels_.size()) continue;
    Clip& clip = clips[source_.frames[of_clip].sequence];
    const std::string stem = std::filesystem::path(frame.name).stem().string();
    clip.last = std::max(clip.last, find_number(stem).number);
  }
  for (const auto& [name, clip] : clips) {
    if (clip.first != 1 || clip.last != clip.count) continue;
    warnings_.push_back("frames of " + name + " are named by the numbers 1 to " +
                        std::to_string(clip.count) + " in " + labels_path + ", and " + name +
                        "/0 has no label: if these count from 1, all labels are one frame late; "
                        "count from 0 then");
    break;
  }
}

void OwnLabels::note_without_label(const std::string& labels_path) {
  std::size_t without = 0;
  for (const FrameLabel& label : labels_) without += label.key.empty();
  if (without == 0) return;
  notes_.push_back("no label for " + std::to_string(without) + " of " +
                   count_text(std::ssize(labels_), "frame") + " in " + labels_path +
                   ": no samples of their own");
}

Outcome<ImageSize> OwnLabels::image_size(const std::string& label_key,
                                         std::optional<ImageSize> claimed) const {
  const auto found = frame_of_key_.find(label_key);
  if (found == frame_of_key_.end()) {
    return SampleFault{"expected a label of an image of the source, got one of none, in " +
                       label_place(label_key)};
  }
  const SourceFrame& frame = source_.frames[found->second];
  const auto file = source_.root.on_disk(frame.name);
  constexpr auto kUpright = ImageOrientation::kUpright;
  Outcome<ImageSize> size =
      frame.size ? Outcome<ImageSize>(*frame.size) : image_sizes_->of(file, kUpright);
  if (is_fault(size)) size = probe_image_size(file, kUpright);  // it may have been mended since
  if (is_fault(size) || !claimed || *size == *claimed) return size;
  const Outcome<ImageSize> stored =
      frame.size ? size : probe_image_size(file, ImageOrientation::kStored);
  const bool is_turned = !is_fault(stored) && *stored == *claimed;
  return SampleFault{"expected an image of " + to_string(*claimed) + ", as " +
                     label_place(label_key) + " says, got " + to_string(*size) +
                     (is_turned ? ", turned upright as its EXIF orientation says" : "") + ", in " +
                     source_.root.written(frame.name)};
}

}  // namespace eventgan

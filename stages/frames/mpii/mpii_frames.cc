#include "stages/frames/mpii/mpii_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAnnotations = "mpii_human_pose_v1_u12_1.mat";
constexpr const char* kKeyframes = "mpii_human_pose_v1_sequences_keyframes.mat";

std::string find_file(const std::vector<std::string>& folders, const char* name,
                      const fs::path& base) {
  for (const std::string& folder : folders) {
    const SourceRoot root(folder, base);
    if (root.has_file(name)) return root.written(name);
  }
  return {};
}

std::vector<std::string> annotation_folders(const SourceRoot& root) {
  return {root.written(""), root.written("mpii_human_pose_v1_u12_2")};
}

[[noreturn]] void refuse_missing(const char* name, const std::vector<std::string>& folders,
                                 const fs::path& base) {
  const auto place = [&](const std::string& folder) { return (base / folder).string(); };
  throw InputError(
      fmt::format("expected {}, got none, in {}", name, joined(folders, " or ", place)));
}

}  // namespace

fs::path find_mpii_annotations(const fs::path& root) {
  return find_file(annotation_folders(SourceRoot(root.string(), "")), kAnnotations, "");
}

std::string find_mpii_keyframes(const std::vector<std::string>& folders, const fs::path& base) {
  return find_file(folders, kKeyframes, base);
}

MpiiPlaces find_mpii_places(const SourceSpec& spec, const fs::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  MpiiPlaces places;
  places.image_folders = {root.written("images")};

  const SourceRoot annotations(spec.annotations.value_or(spec.root), base);
  if (annotations.has_file("")) {
    places.annotations = annotations.written("");
  } else {
    const std::vector<std::string> folders = annotation_folders(annotations);
    places.annotations = find_file(folders, kAnnotations, base);
    if (places.annotations.empty()) refuse_missing(kAnnotations, folders, base);
  }
  const std::vector<std::string> beside = {
      fs::path(places.annotations).parent_path().generic_string(), spec.root};
  places.keyframes = find_mpii_keyframes(beside, base);

  if (spec.sequences) {
    SourceRoot(*spec.sequences, base).require_folder("");
    places.sequence_folders = {*spec.sequences};
  } else {
    places.sequence_folders = {root.written("sequences")};
    for (const std::string& name : root.folders_in("")) {
      if (name.starts_with(kMpiiBatchPrefix)) places.sequence_folders.push_back(root.written(name));
    }
  }
  const bool has_sequences =
      std::ranges::any_of(places.sequence_folders,
                          [&](const std::string& folder) { return has_folder(base / folder); });
  if (places.keyframes.empty() && has_sequences && !spec.pairs.stills) {
    refuse_missing(kKeyframes, beside, base);
  }
  return places;
}

bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error_a, error_b;
  const auto size_a = std::filesystem::file_size(a, error_a);
  const auto size_b = std::filesystem::file_size(b, error_b);
  if (error_a || error_b || size_a != size_b) return false;
  std::string nobody_asks;
  const auto text = try_read_file(a, nobody_asks);
  return text && text == try_read_file(b, nobody_asks);
}

namespace {

std::string joined(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).generic_string();
}

struct Keyframe {
  std::string sequence;
  std::int64_t number = 0;
};

/// "037454012/00000053.jpg" in its parts; nothing if it has another form.
std::optional<Keyframe> parse_keyframe(const std::string& keyframe) {
  const std::size_t slash = keyframe.rfind('/');
  if (slash == std::string::npos || slash == 0) return std::nullopt;
  const std::string digits = without_extension(std::string_view(keyframe).substr(slash + 1));
  Keyframe parsed{keyframe.substr(0, slash), 0};
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, parsed.number);
  if (error != std::errc() || stop != end || parsed.number < 0) return std::nullopt;
  return parsed;
}

Outcome<ImageSize> size_of(const fs::path& base, const std::string& image) {
  try {
    return image_file_size(base / image);
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + image};
  }
}

bool have_one_shape(ImageSize a, ImageSize b) {
  const auto [small, large] = a.width <= b.width ? std::pair(a, b) : std::pair(b, a);
  const double width = large.width * static_cast<double>(small.height) / large.height;
  const double height = large.height * static_cast<double>(small.width) / large.width;
  return std::abs(width - small.width) <= 1 || std::abs(height - small.height) <= 1;
}

}  // namespace

MpiiFrames::MpiiFrames(fs::path base, std::vector<std::string> image_folders,
                       const std::vector<std::string>& sequence_folders)
    : base_(std::move(base)), image_folders_(std::move(image_folders)) {
  for (const std::string& folder : image_folders_) {
    for (const std::string& name : list_folder(base_ / folder).files) {
      images_.try_emplace(name, joined(folder, name));
    }
  }
  for (const std::string& folder : sequence_folders) {
    for (const std::string& name : list_folder(base_ / folder).folders) {
      if (!name.starts_with(kMpiiBatchPrefix)) {
        sequences_.try_emplace(name, joined(folder, name));
        continue;
      }
      const std::string batch = joined(folder, name);
      for (const std::string& inner : list_folder(base_ / batch).folders) {
        sequences_.try_emplace(inner, joined(batch, inner));
      }
    }
  }
}

LabelledFrame MpiiFrames::labelled(const std::string& image, const std::string& keyframe) const {
  LabelledFrame labelled;
  labelled.sample_id = without_extension(image);
  if (const auto parsed = parse_keyframe(keyframe)) {
    labelled.frame.index = parsed->number;
    if (const auto sequence = sequences_.find(parsed->sequence); sequence != sequences_.end()) {
      labelled.sequence = parsed->sequence;
      labelled.frame.path =
          joined(sequence->second.folder, keyframe.substr(keyframe.rfind('/') + 1));
      return labelled;
    }
  }
  const auto entry = images_.find(image);
  labelled.frame.path =
      entry != images_.end() ? entry->second : joined(image_folders_.front(), image);
  return labelled;
}

const NumberedSequence& MpiiFrames::frames_of(const Sequence& sequence) const {
  std::call_once(sequence.listed,
                 [&] { sequence.frames = NumberedSequence::list(base_ / sequence.folder); });
  return sequence.frames;
}

PairedFrame MpiiFrames::paired_frame(const LabelledFrame& labelled, int steps) const {
  using State = PairedFrame::State;
  const auto sequence = sequences_.find(labelled.sequence);
  if (sequence == sequences_.end()) {
    if (steps != 0) return {};
    const bool present = images_.contains(fs::path(labelled.frame.path).filename().string());
    return {present ? State::kPresent : State::kMissing, labelled.frame};
  }
  const auto place = frames_of(sequence->second).at(labelled.frame.index, steps);
  if (place.state == State::kBeyond) return {};
  if (steps == 0 && place.state == State::kMissing) return {State::kMissing, labelled.frame};
  PairedFrame paired_frame{place.state, {}};
  paired_frame.frame.path = joined(sequence->second.folder, place.name);
  paired_frame.frame.index = place.number;
  return paired_frame;
}

Outcome<LabelScale> MpiiFrames::label_scale(const std::string& image,
                                            const std::string& frame) const {
  const auto entry = images_.find(image);
  if (entry == images_.end() || entry->second == frame) return LabelScale{};
  const Outcome<ImageSize> annotated = size_of(base_, entry->second);
  if (is_fault(annotated)) return annotated.fault();
  const Outcome<ImageSize> stored = size_of(base_, frame);
  if (is_fault(stored)) return LabelScale{};
  const auto& from = *annotated;
  const auto& to = *stored;
  if (!have_one_shape(from, to)) {
    return SampleFault{"expected a frame of the shape of " + entry->second + ", " +
                       to_string(from) + ", where it was annotated, got " + to_string(to) +
                       ", in " + frame};
  }
  return LabelScale{static_cast<double>(to.width) / from.width,
                    static_cast<double>(to.height) / from.height};
}

bool MpiiFrames::is_without_image(const LabelledFrame& labelled, const std::string& image) const {
  return !labelled.sequence.empty() && !images_.contains(image);
}

std::string MpiiFrames::find_keyframe(const std::string& image) const {
  const auto sequence = sequences_.find(without_extension(image));
  const auto entry = images_.find(image);
  if (sequence == sequences_.end() || entry == images_.end()) return {};
  for (const auto& [number, name] : frames_of(sequence->second).frames()) {
    if (same_bytes(base_ / entry->second, base_ / sequence->second.folder / name)) {
      return sequence->first + "/" + name;
    }
  }
  return {};
}

void scale_labels(const LabelScale& scale, std::vector<Person>& persons) {
  if (scale.x == 1 && scale.y == 1) return;
  const auto move = [&scale](Point& point) {
    if (point == kMissingPoint) return;
    point = {(point.x + 0.5) * scale.x - 0.5, (point.y + 0.5) * scale.y - 0.5};
  };
  for (Person& person : persons) {
    for (Joint& joint : person.joints) move(joint.at);
    move(person.center);
    if (person.scale != -1) person.scale *= std::sqrt(scale.x * scale.y);
    if (!person.head_box) continue;
    Rectangle& head = *person.head_box;
    head = {head.left * scale.x, head.top * scale.y, head.right * scale.x, head.bottom * scale.y};
  }
}

std::string without_extension(std::string_view name) {
  const std::size_t dot = name.rfind('.');
  return std::string(dot == std::string_view::npos || dot == 0 ? name : name.substr(0, dot));
}

void sort_samples(std::vector<LabelledFrame>& frames, const fs::path& file) {
  std::ranges::sort(frames, {}, &LabelledFrame::sample_id);
  const auto twice = std::ranges::adjacent_find(frames, {}, &LabelledFrame::sample_id);
  if (twice != frames.end()) {
    throw InputError("expected each image once, got " + twice->sample_id + " twice, in " +
                     file.string());
  }
}

}  // namespace eventgan

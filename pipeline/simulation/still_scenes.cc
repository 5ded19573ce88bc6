#include "pipeline/simulation/still_scenes.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text.h"
#include "manifests/documents/manifest_fields.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/outlines.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/placement.h"
#include "manifests/values/still_motion.h"
#include "pipeline/simulation/clip_frames.h"
#include "stages/events/simulation/sensor.h"
#include "stages/frames/decoding/still_clip.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/frames/sources/still_clips.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {
namespace {

/// What is there, or an InputError that says why not.
template <class Value>
Value found(Outcome<Value> outcome) {
  if (is_fault(outcome)) throw InputError(outcome.fault().reason);
  return *std::move(outcome);
}

/// A clip as a sensor sees it.
struct Seen {
  Seen(GreyImage still, std::vector<Box> boxes, const StillPose& pose,
       std::optional<ImageSize> sensor)
      : image(std::move(still)),
        clip({image.size, image.pixels.data(), ImageView::Channels::kGrey}, std::move(boxes), pose),
        size(sensor),
        placement(sensor_placement(clip.size(), sensor)) {}

  GreyImage frame(const StillPose& pose) const {
    return sensor_image(GreyImage{clip.size(), clip.frame(pose)}, size);
  }

  GreyImage image;
  StillClip clip;
  std::optional<ImageSize> size;
  Placement placement;
};

/// From one frame of the clip to the next.
class StillInterval final : public Interval {
 public:
  StillInterval(std::shared_ptr<const Seen> seen, const StillPose& from, const StillPose& to)
      : seen_(std::move(seen)), from_(from), to_(to) {
    const Placement& placement = seen_->placement;
    steps_ = std::max(
        1, static_cast<int>(std::ceil(seen_->clip.displacement_px(from_, to_) *
                                      std::max(placement.scale_x(), placement.scale_y()))));
  }

  ImageSize size() const override { return seen_->placement.volume; }
  int steps() const override { return steps_; }
  std::vector<float> render(int step) const override {
    const double u = static_cast<double>(step) / steps_;
    return linear_intensity(seen_->frame(pose_between(from_, to_, u)));
  }

  FlowDisplacement flow() const override {
    const Placement& placement = seen_->placement;
    const ImageSize frame = placement.source;
    const auto shifts = seen_->clip.shifts_px(from_, to_);
    FlowDisplacement flow{size(), {}, {}};
    flow.x_px.reserve(flow.size.pixel_count());
    flow.y_px.reserve(flow.size.pixel_count());
    const auto nearest = [](double place, int side) {
      return static_cast<std::size_t>(std::clamp<long>(std::lround(place), 0, side - 1));
    };
    for (int y = 0; y < flow.size.height; ++y) {
      for (int x = 0; x < flow.size.width; ++x) {
        const Point at = to_source(placement, Point{double(x), double(y)});
        const std::size_t pixel =
            nearest(at.y, frame.height) * static_cast<std::size_t>(frame.width) +
            nearest(at.x, frame.width);
        flow.x_px.push_back(static_cast<float>(shifts[0][pixel] * placement.scale_x()));
        flow.y_px.push_back(static_cast<float>(shifts[1][pixel] * placement.scale_y()));
      }
    }
    return flow;
  }

 private:
  std::shared_ptr<const Seen> seen_;
  StillPose from_, to_;
  int steps_;
};

class StillScene final : public Scene {
 public:
  /// `poses` of its frames, at `times_s`.
  StillScene(std::shared_ptr<const Seen> seen, std::vector<StillPose> poses,
             std::vector<double> times_s)
      : seen_(std::move(seen)),
        poses_(std::move(poses)),
        times_s_(std::move(times_s)),
        frame_(seen_->frame(poses_.at(0))) {}

  const GreyImage& frame() const override { return frame_; }
  double time_s() const override { return times_s_[position_]; }
  bool has_flow() const override { return true; }

  std::unique_ptr<Interval> advance() override {
    if (position_ + 1 == poses_.size()) return nullptr;
    ++position_;
    frame_ = seen_->frame(poses_[position_]);
    return std::make_unique<StillInterval>(seen_, poses_[position_ - 1], poses_[position_]);
  }

 private:
  std::shared_ptr<const Seen> seen_;
  std::vector<StillPose> poses_;
  std::vector<double> times_s_;
  std::size_t position_ = 0;
  GreyImage frame_;
};

nlohmann::ordered_json box_json(const Rectangle& box) {
  return {{"left", box.left}, {"top", box.top}, {"right", box.right}, {"bottom", box.bottom}};
}

nlohmann::ordered_json person_json(const VolumePerson& mapped, const Person& person) {
  nlohmann::ordered_json joints = nlohmann::json::array();
  for (std::size_t j = 0; j < mapped.joints.size(); ++j) {
    nlohmann::ordered_json& joint = joints.emplace_back(nlohmann::json::array());
    if (mapped.joints[j] == kMissingPoint) continue;
    joint = {mapped.joints[j].x, mapped.joints[j].y};
    if (person.joints[j].visible >= 0) joint.push_back(person.joints[j].visible);
  }
  nlohmann::ordered_json json = {{"joints", std::move(joints)}};
  if (mapped.center != kMissingPoint) json["center"] = {mapped.center.x, mapped.center.y};
  if (mapped.scale >= 0) json["scale"] = mapped.scale;
  if (const auto& head = mapped.head_box) {
    json["head_box"] = {head->left, head->top, head->right, head->bottom};
  }
  return json;
}

/// What of a labelled frame's pair is the later one: itself, or the one after it.
int next_of(const SourceSpec& spec) { return spec.pairs.side == PairSide::kBefore ? 0 : 1; }

/// What an annotation says that the scene or its labels depend on, beyond what `original` has.
std::string text_of(const Annotation& annotation, const LabelSchema& schema) {
  std::string text = annotation.original;
  for (const std::string& joint : schema.joint_names) text += "\njoint " + joint;
  for (const Box& box : annotation.boxes) {
    text += fmt::format("\n{} {} {} {} {} {} {}",
                        schema.class_names.at(static_cast<std::size_t>(box.class_id)),
                        box.xyxy.left, box.xyxy.top, box.xyxy.right, box.xyxy.bottom, box.ignore,
                        outline_text(box.outline));
  }
  return text;
}

}  // namespace

StillScenes::StillScenes(const SimulationSource& source, const SimulationManifest& manifest)
    : size_(manifest.size),
      job_(read_job_manifest(resolve(manifest, source.path))),
      decoder_(job_.directory) {
  for (const SourceSpec& spec : job_.sources) {
    datasets_.push_back(spec.pairs.clip_frames ? open_dataset(spec, job_.directory) : nullptr);
  }
  make_clips(job_, datasets_);
  number_classes(job_.sources, datasets_);
  std::int64_t length = 0;
  for (std::size_t i = 0; i < datasets_.size(); ++i) {
    if (!datasets_[i]) continue;
    std::map<std::string, std::vector<const LabelledFrame*>> stills;
    for (const LabelledFrame& frame : datasets_[i]->labelled_frames()) {
      stills[frame.sequence].push_back(&frame);
    }
    for (auto& [still, frames] : stills) {
      const std::int64_t number = length++ - source.first_frame;
      const bool is_enough = source.frame_count > 0 && count() == source.frame_count;
      if (number < 0 || number % source.frame_step != 0 || is_enough) continue;
      const double start_s =
          datasets_[i]->paired_frame(*frames[0], next_of(job_.sources[i])).frame.time_s;
      clips_.push_back({i, still, std::move(frames), start_s});
    }
  }
  const std::int64_t least = std::max<std::int64_t>(source.frame_count, 1);
  if (count() >= least) return;
  throw InputError(fmt::format(
      "expected {} or more stills from still {} on in steps of {}, got {} of {} in the sources "
      "with \"pairs\": {{\"from\": \"stills\", \"frames\": N}}, in {}",
      least, source.first_frame, source.frame_step, count(), length,
      resolve(manifest, source.path).string()));
}

std::string StillScenes::hash(std::int64_t position) const {
  const Clip& clip = this->clip(position);
  if (!clip.frames[0]->fault.empty()) throw InputError(clip.frames[0]->fault);
  const SourceSpec& spec = job_.sources[clip.source];
  const FrameRef& image = clip.frames[0]->frame;
  const std::filesystem::path file = resolve(job_, image.path);
  std::error_code absent;  // reading it says so
  std::string text = fmt::format("{} {} {} {} {} {}\n", job_.seed, to_string(spec.dataset),
                                 source_key(job_.sources, clip.source), spec.every,
                                 spec.frames_per_second.value_or(0), clip.still);
  text += fmt::format("{}\t{}\t{}\n", file.filename().string(),
                      std::filesystem::file_size(file, absent), image.video_frame);
  const std::string pairs = fmt::format("$.sources[{}].pairs.", clip.source);
  for (const auto& [field, value] : manifest_fields(job_.text)) {
    if (field.starts_with(pairs)) text += field.substr(pairs.size()) + " " + value + "\n";
    if (field.starts_with("$.image.range")) text += field + " " + value + "\n";
  }
  const Dataset& dataset = *datasets_[clip.source];
  text +=
      text_of(found(dataset.still_annotation(clip.frames[0]->label_key)), dataset.label_schema());
  return sha256_hex(text);
}

ImageSize StillScenes::frame_size(std::int64_t position) const {
  const Clip& clip = this->clip(position);
  return datasets_[clip.source]->made_size(clip.frames[0]->label_key).value();
}

std::unique_ptr<Scene> StillScenes::scene(std::int64_t position) const try {
  const Clip& clip = this->clip(position);
  const SourceSpec& spec = job_.sources[clip.source];
  const FrameRef& image = clip.frames[0]->frame;
  std::vector<StillPose> poses;
  std::vector<double> times_s;
  std::vector<Box> boxes;
  const Dataset& dataset = *datasets_[clip.source];
  const int next = next_of(spec);
  for (const LabelledFrame* frame : clip.frames) {
    MadePair made = found(dataset.made_pair(frame->label_key));
    if (poses.empty()) boxes = std::move(made.boxes);
    poses.push_back(std::move(made.poses.at(1)));
    times_s.push_back(dataset.paired_frame(*frame, next).frame.time_s - clip.start_s);
  }
  const ColourFrame colour =
      found(decoder_.decode(image, spec.every, orientation_of(spec.dataset), job_.image.range));
  auto seen = std::make_shared<const Seen>(grey_image(colour), std::move(boxes), poses[0], size_);
  return std::make_unique<StillScene>(std::move(seen), std::move(poses), std::move(times_s));
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(fmt::format("{}, in {}", error.what(), clip(position).frames[0]->frame.path));
}

std::string StillScenes::labels(std::int64_t position) const {
  const Clip& clip = this->clip(position);
  const Dataset& dataset = *datasets_[clip.source];
  const LabelSchema& schema = dataset.label_schema();
  nlohmann::ordered_json samples = nlohmann::json::array();
  for (const LabelledFrame* frame : std::span(clip.frames).subspan(1)) {
    const Annotation annotation = found(dataset.annotation(frame->label_key));
    const Placement placement =
        sensor_placement(dataset.made_size(frame->label_key).value(), size_);
    const VolumeLabels mapped =
        found(map_labels(annotation, placement, dataset.label_place(frame->label_key)));
    nlohmann::ordered_json& sample = samples.emplace_back();
    sample["time_s"] = frame->frame.time_s - clip.start_s;
    for (std::size_t k = 0; k < mapped.boxes.size(); ++k) {
      const Box& box = annotation.boxes[k];
      if (is_empty(mapped.boxes[k].clipped)) continue;
      nlohmann::ordered_json& json =
          sample["boxes"].emplace_back(box_json(mapped.boxes[k].clipped));
      json["class"] = schema.class_names.at(static_cast<std::size_t>(box.class_id));
      if (mapped.boxes[k].ignore) json["category"] = "dont_care";
      if (box.track_id >= 0) json["track"] = box.track_id;
    }
    for (std::size_t k = 0; k < mapped.persons.size(); ++k) {
      sample["persons"].push_back(person_json(mapped.persons[k], annotation.persons[k]));
    }
  }
  nlohmann::ordered_json json = {{"format", "eventgan-labels"}, {"version", 1}};
  if (!schema.joint_names.empty()) json["joint_names"] = schema.joint_names;
  json["samples"] = std::move(samples);
  return dump_json(json) + "\n";
}

}  // namespace eventgan

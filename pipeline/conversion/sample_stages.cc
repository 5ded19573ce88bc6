#include "pipeline/conversion/sample_stages.h"

#include <limits>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/values/still_motion.h"
#include "pipeline/conversion/pair_volume.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {
namespace {

/// Adds the processor time that the calling thread spends in its scope to one stage of a message.
class Stopwatch {
 public:
  Stopwatch(SampleMessage& message, Stage stage)
      : seconds_(message.seconds[static_cast<std::size_t>(stage)]) {}
  ~Stopwatch() { seconds_ += 1e-9 * static_cast<double>(thread_processor_ns() - start_ns_); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& seconds_;
  std::int64_t start_ns_ = thread_processor_ns();
};

std::string frame_names(const FramePair& pair) {
  return pair.previous.path + " and " + pair.next.path;
}

/// `values = {}` would keep it.
template <class T>
void free_memory(std::vector<T>& values) {
  values = std::vector<T>();
}

/// Rethrows the current exception as one that says at which sample it was.
[[noreturn]] void name_sample(const SampleMessage& message, const char* work) {
  const PlannedSample& planned = message.planned();
  std::throw_with_nested(std::runtime_error(
      std::string("cannot ") + work + " a pair of " + to_string(message.shard->volume_size) +
      ", in " + frame_names(planned.pair) + " (" + planned.sample_id + ")"));
}

}  // namespace

InputCounts SampleMessage::input_counts() const {
  const bool is_empty = !same_image && (sample.statistics.flags & kFlagEmpty) != 0;
  return {losses_of(sample.annotation), same_image, is_empty, outlines};
}

void SampleMessage::fail(std::string reason) {
  sample.valid = false;
  const std::string id = " (" + sample.sample_id + ")";
  if (!reason.ends_with(id)) reason += id;
  sample.fault = std::move(reason);
  sample.flow = {};
  sample.threshold = std::nullopt;
  sample.tiles = {};
  prepared = {};
  free_memory(events);
  free_memory(volume);
  free_memory(chunk);
}

SampleStages::SampleStages(const JobManifest& manifest,
                           const std::vector<std::unique_ptr<Dataset>>& datasets,
                           const Generator& generator, int in_flight)
    : manifest_(manifest),
      datasets_(datasets),
      generator_(generator),
      in_flight_(static_cast<std::size_t>(in_flight)),
      reader_(manifest.directory, manifest.image, in_flight,
              generator_row(manifest.generator.kind).sees_between),
      codec_(manifest.output.dtype, manifest.output.deflate_level) {
  for (std::size_t i = 0; i < manifest.sources.size(); ++i) {
    source_keys_.push_back(source_key(manifest.sources, i));
  }
}

void SampleStages::read(SampleMessage& message) const try {
  const Stopwatch stopwatch(message, Stage::kRead);
  const PlannedSample& planned = message.planned();
  message.sample.sample_id = planned.sample_id;
  message.sample.sequence = planned.sequence;
  const auto source = static_cast<std::size_t>(message.shard->source);
  const DatasetKind kind = manifest_.sources[source].dataset;
  message.sample.origin = frame_origin(kind, planned.sequence);
  message.sample.pair = planned.pair;
  message.sample.source_to_volume.fill(std::numeric_limits<double>::quiet_NaN());
  Outcome<Annotation> annotation = datasets_[source]->annotation(planned.label_key);
  std::vector<Box> boxes = is_fault(annotation) ? std::vector<Box>() : annotation->boxes;
  settle_motion(manifest_.sources[source].pairs, key_of(message), boxes, std::nullopt,
                message.sample.pair);
  Outcome<MadePair> made = datasets_[source]->made_pair(planned.label_key);
  if (!is_fault(made) && !made->poses.empty()) {
    message.sample.pair.poses = std::move(made->poses);
    boxes = std::move(made->boxes);
  }
  if (!planned.fault.empty() || is_fault(made)) {
    message.fail(planned.fault.empty() ? made.fault().reason : planned.fault);
  } else if (has_events(kind)) {
    read_events(message, *datasets_[source]);
  } else {
    read_frames(message, boxes);
    if (!message.failed()) message.outlines += made->outlines;
  }
  const SourceSpec& spec = manifest_.sources[source];
  if (spec.flow && !spec.pairs.stills && !message.failed()) {
    Outcome<PixelFlow> flow =
        true_flow(*datasets_[source], planned.label_key, message.prepared.placement);
    if (is_fault(flow)) {
      message.fail(flow.fault().reason);
    } else {
      message.sample.flow = *std::move(flow);
    }
  }
  read_labels(message, *datasets_[source], std::move(annotation));
} catch (const std::bad_alloc&) {
  name_sample(message, "read");
}

void SampleStages::read_frames(SampleMessage& message, const std::vector<Box>& boxes) const {
  const auto slot = static_cast<std::size_t>(message.slot);
  const SourceSpec& source = manifest_.sources[static_cast<std::size_t>(message.shard->source)];
  const ImageOrientation orientation = orientation_of(source.dataset);
  const std::vector<PlannedSample>& samples = message.shard->samples;
  for (std::size_t i = slot == 0 ? 1 : slot + in_flight_;
       i <= slot + in_flight_ && i < samples.size(); ++i) {
    reader_.expect(samples[i].pair, orientation);
  }
  const auto settle = [&](FramePair pair, ImageSize size) {
    settle_motion(source.pairs, key_of(message), boxes, size, pair);
    return pair;
  };
  Outcome<PreparedPair> prepared =
      reader_.read(message.sample.pair, orientation, source.every, boxes, settle, source.flow);
  if (is_fault(prepared)) {
    message.fail(prepared.fault().reason);
  } else {
    message.prepared = std::move(*prepared);
    message.outlines = message.prepared.outlines;
    if (message.prepared.settled) message.sample.pair = std::move(*message.prepared.settled);
    message.sample.flow = std::move(message.prepared.flow);
    take_placement(message);
  }
}

void SampleStages::read_events(SampleMessage& message, const Dataset& dataset) const {
  Outcome<EventWindow> outcome = dataset.events(message.planned().label_key);
  if (is_fault(outcome)) {
    message.fail(outcome.fault().reason);
    return;
  }
  EventWindow& window = *outcome;
  window.tell_times(message.sample.pair);
  PreparedPair& prepared = message.prepared;
  prepared.placement = place(window.sensor, manifest_.image);
  const VisiblePart part = visible_part(prepared.placement);
  prepared.content = part.size;
  prepared.content_x = part.volume_x;
  prepared.content_y = part.volume_y;
  message.events = std::move(window.events);
  // The window's, whatever a crop leaves of it.
  if (!message.events.empty()) {
    message.event_times_s = {message.events.front().t_s, message.events.back().t_s};
  }
  place_events(prepared.placement, message.events);
  for (Event& event : message.events) {
    event.x -= part.volume_x;
    event.y -= part.volume_y;
  }
  take_placement(message);
}

void SampleStages::take_placement(SampleMessage& message) const {
  const Placement& placement = message.prepared.placement;
  message.sample.source_size = placement.source;
  message.sample.source_to_volume = placement.source_to_volume();
  if (placement.volume == message.shard->volume_size) return;
  message.fail("expected frames of " + to_string(message.shard->volume_size) + ", got " +
               to_string(placement.volume) + ", in " + frame_names(message.planned().pair) +
               " (a new plan would put it into another shard: convert into another folder, or with "
               "--overwrite)");
}

void SampleStages::read_labels(SampleMessage& message, const Dataset& dataset,
                               Outcome<Annotation> annotation) const {
  const PlannedSample& planned = message.planned();
  if (is_fault(annotation)) {
    if (!message.failed()) message.fail(annotation.fault().reason);
    return;
  }
  message.sample.annotation = std::move(*annotation);
  const std::vector<std::string>& left_out = message.sample.annotation.left_out;
  if (!left_out.empty() && !message.failed() && manifest_.errors.policy == ErrorPolicy::kFail) {
    message.fail(left_out.front());
  }
  if (!message.failed()) {
    Outcome<VolumeLabels> labels = map_labels(message.sample.annotation, message.prepared.placement,
                                              dataset.label_place(planned.label_key));
    if (!is_fault(labels)) {
      message.sample.labels = std::move(*labels);
      return;
    }
    message.fail(labels.fault().reason);
  }
  // Without a usable image or label there is no place in the volume; the original text is kept.
  message.sample.annotation.boxes.clear();
  message.sample.annotation.persons.clear();
}

std::vector<float> SampleStages::take_volume(std::size_t value_count) const {
  std::vector<float> volume;
  {
    const std::lock_guard lock(spare_volumes_mutex_);
    if (spare_volumes_.empty()) {
      ++volumes_made_;
    } else {
      volume = std::move(spare_volumes_.back());
      spare_volumes_.pop_back();
    }
  }
  volume.resize(value_count);
  return volume;
}

PairKey SampleStages::key_of(const SampleMessage& message) const {
  const auto source = static_cast<std::size_t>(message.shard->source);
  return {manifest_.seed, to_string(manifest_.sources[source].dataset), message.sample.sample_id,
          source_keys_[source]};
}

void SampleStages::generate(SampleMessage& message) const try {
  if (message.failed()) return;
  const Stopwatch stopwatch(message, Stage::kGenerate);
  const PreparedPair& prepared = message.prepared;
  if (!needs_frames(manifest_.generator.kind)) {
    message.volume =
        event_volume(message.events, {generator_.bins(), prepared.content}, message.event_times_s);
    free_memory(message.events);
    return;
  }
  message.volume = take_volume(VolumeShape{generator_.bins(), prepared.content}.value_count());
  GeneratedPart part = generate_volume(generator_, manifest_.generator, key_of(message), prepared,
                                       message.sample.labels, message.volume);
  if (part.threshold) message.sample.threshold = part.threshold->mean;
  message.notes = part.notes;
  message.same_image = part.same_image;
  message.sample.tiles = std::move(part.tiles);
  free_memory(message.prepared.input);
} catch (const std::exception&) {
  name_sample(message, "generate the volume of");
}

void SampleStages::finish(SampleMessage& message) const try {
  if (message.failed()) return;
  const Stopwatch stopwatch(message, Stage::kFinish);
  const PreparedPair& prepared = message.prepared;
  const FramePair& pair = message.planned().pair;
  const bool has_noise = add_pair_noise(manifest_.generator, key_of(message), pair.gap_s(),
                                        {generator_.bins(), prepared.content}, message.volume);
  const std::optional<VolumeStatistics> found =
      finish_volume(generator_, message.notes, pair.gap_frames, manifest_.volume.normalize,
                    prepared, message.volume);
  if (!found) {
    const std::size_t bad = first_unsound_value(message.volume);
    message.fail("expected finite values >= 0, got " + std::to_string(message.volume[bad]) +
                 " in channel " + std::to_string(bad / prepared.content.pixel_count()) +
                 " of the generated volume, in " + frame_names(pair));
    return;
  }
  VolumeStatistics& statistics = message.sample.statistics = *found;
  const bool reaches_one =
      manifest_.volume.normalize == Normalization::kEta98 && statistics.max > 0;
  EncodedVolume encoded = codec_.encode(message.volume,
                                        {{generator_.bins(), prepared.placement.volume},
                                         prepared.content,
                                         prepared.content_x,
                                         prepared.content_y},
                                        reaches_one ? 1 : statistics.max);
  if (has_noise) statistics.flags |= kFlagNoise;
  if (encoded.saturated) statistics.flags |= kFlagSaturated;
  if (encoded.vanished) statistics.flags |= kFlagVanished;
  message.sample.scale = encoded.scale;
  message.chunk = std::move(encoded.chunk);
  {
    const std::lock_guard lock(spare_volumes_mutex_);
    if (spare_volumes_.size() < volumes_made_) spare_volumes_.push_back(std::move(message.volume));
  }
  free_memory(message.volume);
  message.prepared = {};
} catch (const std::bad_alloc&) {
  name_sample(message, "store the volume of");
}

}  // namespace eventgan

#include "pipeline/preview/preview_reader.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <optional>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/placement.h"
#include "manifests/values/text.h"
#include "manifests/values/words.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_guard.h"
#include "stages/frames/decoding/cut_out.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/decoding/still_clip.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/frames/sources/still_clips.h"
#include "stages/recordings/order/event_index.h"
#include "stages/recordings/readers/recording.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {

/// A recording that is open: opening one may read all of it.
struct OpenRecording {
  std::filesystem::path path{};
  RecordingOptions options{};
  std::unique_ptr<Recording> recording{};
};

namespace {

namespace fs = std::filesystem;

constexpr char kNoSource[] =
    "expected the shard's plan beside it, since its manifest has several such sources, got none";

/// The frame of a recording of events, of `last` if it is that one; a fault names its file.
/// `source`: that of the sample, if known. A path alone does not lead to it: two sources can be the
/// two cameras of one file. `job`: the folder of its shard, which may know where its times lie.
Outcome<ColourFrame> decode_recorded(const fs::path& folder, const fs::path& job,
                                     const SourceSpec* source, const FrameRef& frame,
                                     OpenRecording& last) try {
  const fs::path path = folder / frame.path;
  if (source == nullptr) return SampleFault{kNoSource + (", for a frame in " + path.string())};
  if (!last.recording || last.path != path || last.options != source->recording) {
    const EventIndexes indexes(job / kEventIndexFile);
    last = {path, source->recording, open_recording(path, {}, source->recording)};
  }
  const GreyImage grey = last.recording->frame(frame.video_frame);
  ColourFrame colour{grey.size, {}};
  for (const std::uint8_t pixel : grey.pixels) colour.bgr.insert(colour.bgr.end(), 3, pixel);
  return colour;
} catch (const std::exception& error) {
  return SampleFault{error.what()};
}

/// Whether `frame` is the one of a still's pair that is moved.
bool is_moved(const FrameRef& frame, const FramePair& pair) {
  return pair.motion && &frame == (pair.label_position == 1 ? &pair.previous : &pair.next);
}

/// The colour frame, one of those of the sample's pair, laid into the volume; empty, with a
/// warning, if it cannot be had. `boxes`: the still's, of which objects move.
std::vector<std::uint8_t> frame_image(const Outcome<ColourFrame>& decoded, const FrameRef& frame,
                                      const ShardSample& sample, std::vector<Box> boxes,
                                      const ImageSpec& image, std::vector<std::string>& warnings) {
  if (is_fault(decoded)) {
    warnings.push_back(decoded.fault().reason + " (" + sample.sample_id + ")");
    return {};
  }
  const ColourFrame& colour = *decoded;
  if (colour.size != sample.source_size) {
    warnings.push_back(
        "expected the size that the frame had when it was converted, got another, in " +
        frame.path + " (" + sample.sample_id + ")");
    return {};
  }
  try {
    const Placement placement = place(sample.source_size, image, sample.pair);
    if (!is_moved(frame, sample.pair)) return place_colour(colour, placement);
    if (!sample.pair.objects.empty()) cut_out_missing({colour.size, colour.bgr.data()}, boxes);
    return place_colour(move_still(colour, sample.pair, boxes), placement);
  } catch (const std::exception& error) {  // a still whose motion no plan has drawn
    warnings.push_back(error.what() + (", in " + frame.path) + " (" + sample.sample_id + ")");
    return {};
  }
}

}  // namespace

struct PreviewReader::State {
  fs::path base;  ///< where relative frame paths start
  std::vector<std::string>& warnings;
  FrameDecoder decoder;
  OpenRecording recording{};
  fs::path shard{};  ///< that `reader` has open
  std::optional<ShardReader> reader{};
  JobManifest manifest{};
  bool has_events = false;  ///< is made of a camera's events
  /// Of events, of stills whose objects move, and where a labelled frame was asked for: the source
  /// that `shard` is of; null if nothing tells.
  const SourceSpec* source = nullptr;
  std::vector<std::unique_ptr<Dataset>> datasets{};  ///< opened is that of one source
  std::pair<std::string, std::size_t> dataset_of{};  ///< the hash of its plan, its number there
  fs::path planned{};                                ///< the folder whose plan was asked for
  std::optional<FrozenOutline> frozen{};             ///< if it has a sound one

  void open(const fs::path& file) {
    if (reader && shard == file) return;
    reader.reset();
    source = nullptr;
    renew_time_limit();
    reader.emplace(file);
    lift_time_limit();
    manifest = parse_job_manifest(reader->header().manifest_text, base, file.string());
    has_events = !needs_frames(manifest.generator.kind);
    shard = file;
    const auto has_moving_objects = [](const SourceSpec& spec) {
      return spec.pairs.clip_frames || (spec.pairs.stills && spec.pairs.stills->objects);
    };
    if (has_events || std::ranges::any_of(manifest.sources, has_moving_objects)) find_source();
  }

  /// The dataset of `source`.
  const Dataset& labels() {
    const auto number = static_cast<std::size_t>(source - manifest.sources.data());
    if (datasets.empty() || dataset_of != std::pair(reader->header().plan_hash, number)) {
      std::vector<std::unique_ptr<Dataset>> opened(manifest.sources.size());
      opened[number] = open_dataset(*source, manifest.directory);
      make_clips(manifest, opened);
      datasets = std::move(opened);
      dataset_of = {reader->header().plan_hash, number};
    }
    return *datasets[number];
  }

  /// Of `labels`; null if there is none.
  const LabelledFrame* labelled_frame(const ShardSample& sample) {
    const std::vector<LabelledFrame>& all = labels().labelled_frames();
    const auto found =
        std::ranges::lower_bound(all, sample.sample_id, {}, &LabelledFrame::sample_id);
    return found == all.end() || found->sample_id != sample.sample_id ? nullptr : &*found;
  }

  /// The boxes of a still whose objects move: the labels' own where these are as they were, since
  /// the shard's outlines are rounded, and a corner beside a pixel's centre decides what moves.
  std::vector<Box> boxes_of(const ShardSample& sample) try {
    const auto has_outline = [](const Box& box) { return !box.outline.empty(); };
    if (sample.pair.objects.empty() || source == nullptr ||
        std::ranges::none_of(sample.annotation.boxes, has_outline)) {
      return sample.annotation.boxes;
    }
    const LabelledFrame* const labelled = labelled_frame(sample);
    if (labelled == nullptr) return sample.annotation.boxes;
    const Outcome<Annotation> own = labels().annotation(labelled->label_key);
    const bool is_same = !is_fault(own) && own->original == sample.annotation.original &&
                         own->boxes.size() == sample.annotation.boxes.size();
    return is_same ? own->boxes : sample.annotation.boxes;
  } catch (const std::runtime_error&) {  // labels can have been taken elsewhere
    return sample.annotation.boxes;
  }

  /// Whether the pair's frames are those of a clip that is made of a still.
  bool is_made(const ShardSample& sample) const {
    const FramePair& pair = sample.pair;
    return !has_events && !pair.motion && pair.previous.path == pair.next.path &&
           pair.previous.video_frame == pair.next.video_frame &&
           pair.previous.index != pair.next.index;
  }

  /// A frame of the sample, which a file or a recording holds; empty, with a warning, if it cannot
  /// be had.
  std::vector<std::uint8_t> stored_frame(const FrameRef& which, const ShardSample& sample,
                                         const std::vector<Box>& boxes) {
    // Of events there may be no frames, or none yet.
    if (!sample.valid || (has_events && which.video_frame < 0)) return {};
    const DatasetRow* const dataset = find_dataset(reader->header().dataset);
    const ImageOrientation orientation =
        dataset == nullptr ? ImageOrientation::kStored : orientation_of(dataset->value);
    return frame_image(
        has_events
            ? decode_recorded(base, shard.parent_path(), source, which, recording)
            : decoder.decode(which, sample.pair.video_stride(), orientation, manifest.image.range),
        which, sample, boxes, manifest.image, warnings);
  }

  SampleFrames frames_of(const ShardSample& sample) {
    const FramePair& pair = sample.pair;
    const std::vector<Box> boxes =
        sample.valid && pair.motion ? boxes_of(sample) : std::vector<Box>();
    SampleFrames frames;
    if (!sample.valid || !is_made(sample)) {
      frames.previous_bgr = stored_frame(pair.previous, sample, boxes);
      frames.next_bgr = stored_frame(pair.next, sample, boxes);
      return frames;
    }
    Outcome<std::array<ColourFrame, 2>> made = made_frames(sample);
    if (is_fault(made)) {
      warnings.push_back(made.fault().reason + " (" + sample.sample_id + ")");
      return frames;
    }
    const auto laid = [&](ColourFrame& image, const FrameRef& which) {
      return frame_image(std::move(image), which, sample, boxes, manifest.image, warnings);
    };
    frames.previous_bgr = laid((*made)[0], pair.previous);
    frames.next_bgr = laid((*made)[1], pair.next);
    return frames;
  }

  /// The labelled frame, of which a shard has the number alone.
  std::vector<std::uint8_t> labelled_image(const ShardSample& sample) {
    std::string fault = kNoSource;
    try {
      if (source == nullptr) find_source();
      if (source != nullptr) {
        const LabelledFrame* const labelled = labelled_frame(sample);
        if (labelled != nullptr) return stored_frame(labelled->frame, sample, {});
        fault = "expected the labelled frame, got none, in " + source->root;
      }
    } catch (const std::runtime_error& error) {
      fault = error.what();
    }
    warnings.push_back(fault + " (" + sample.sample_id + ")");
    return {};
  }

  /// The frames of a sample of a clip that is made of a still, made again: the shard has neither
  /// the still's boxes nor its poses, but the manifest that they follow from.
  Outcome<std::array<ColourFrame, 2>> made_frames(const ShardSample& sample) try {
    if (source == nullptr) return SampleFault{kNoSource};
    const Dataset& dataset = labels();
    const LabelledFrame* const labelled = labelled_frame(sample);
    if (labelled == nullptr) {
      return SampleFault{"expected its still, got none, in " + source->root};
    }
    Outcome<MadePair> made = dataset.made_pair(labelled->label_key);
    if (is_fault(made)) return made.fault();
    const Outcome<ColourFrame> image = decoder.decode(
        labelled->frame, source->every, orientation_of(source->dataset), manifest.image.range);
    if (is_fault(image)) return image.fault();
    const StillClip clip({image->size, image->bgr.data()}, std::move(made->boxes),
                         made->poses.at(0));
    return std::array{ColourFrame{clip.size(), clip.frame(made->poses.at(0))},
                      ColourFrame{clip.size(), clip.frame(made->poses.at(1))}};
  } catch (const std::runtime_error& error) {
    return SampleFault{error.what()};
  }

  /// The plan beside the shard says which source it is of; without it the manifest does, if it has
  /// only one that can be meant.
  void find_source() {
    const ShardHeader& header = reader->header();
    read_plan(fs::absolute(shard).parent_path());
    source = nullptr;
    if (frozen && frozen->hash == header.plan_hash) {
      for (const ShardOutline& outline : frozen->plan.shards) {
        if (outline.name != header.name) continue;
        source = &manifest.sources.at(static_cast<std::size_t>(outline.source));
        return;
      }
    }
    for (const SourceSpec& spec : manifest.sources) {
      if (to_string(spec.dataset) != header.dataset || spec.split != header.split) continue;
      if (source != nullptr) {
        source = nullptr;
        return;
      }
      source = &spec;
    }
  }

  void read_plan(const fs::path& folder) {
    if (planned == folder) return;
    planned = folder;
    frozen.reset();
    try {
      frozen = read_frozen_outline(folder);
    } catch (const std::runtime_error&) {  // a shard can have been taken elsewhere on its own
    }
  }
};

PreviewReader::PreviewReader(const fs::path& frames, std::vector<std::string>& warnings)
    : state_(new State{frames, warnings, FrameDecoder(frames)}) {}
PreviewReader::~PreviewReader() = default;
PreviewReader::PreviewReader(PreviewReader&&) noexcept = default;

SampleFrames PreviewReader::frames(const fs::path& shard, int slot, bool with_labelled) {
  state_->open(shard);
  renew_time_limit();
  const ShardSample sample = state_->reader->sample(slot);
  lift_time_limit();
  SampleFrames frames = state_->frames_of(sample);
  const double position = sample.pair.label_position;
  if (with_labelled && sample.valid && position > 0 && position < 1) {
    frames.labelled_bgr = state_->labelled_image(sample);
  }
  return frames;
}

PreviewContent PreviewReader::content(const fs::path& shard, int slot) {
  state_->open(shard);
  const ShardReader& reader = *state_->reader;
  const ShardHeader& header = reader.header();
  renew_time_limit();
  ShardSample sample = reader.sample(slot);
  PreviewContent content;
  content.shape = header.volume;
  if (sample.valid) content.volume = reader.volume(slot);
  lift_time_limit();
  SampleFrames frames = state_->frames_of(sample);
  content.previous_bgr = std::move(frames.previous_bgr);
  content.next_bgr = std::move(frames.next_bgr);
  const bool is_made = state_->is_made(sample);
  const FramePair& pair = sample.pair;
  const auto moving = std::ranges::count_if(
      pair.objects, [](const auto& motion) { return motion && *motion != ImageMotion(); });
  const std::string objects =
      moving > 0 ? ", " + count_text(moving, "object") + (moving == 1 ? " moves" : " move") : "";
  content.title = header.dataset + " " + sample.sample_id +
                  (state_->has_events ? fmt::format(", {:.4g} s", pair.gap_s())
                                      : (pair.motion ? ", still" + objects + ", gap "
                                         : is_made   ? ", clip of a still, gap "
                                                     : ", gap ") +
                                            std::to_string(pair.gap_frames)) +
                  (sample.valid ? "" : ", QUARANTINED");
  content.label_position = sample.pair.label_position;
  content.annotation = std::move(sample.annotation);
  content.labels = std::move(sample.labels);
  content.schema = header.label_schema;
  content.flow = std::move(sample.flow);
  return content;
}

}  // namespace eventgan

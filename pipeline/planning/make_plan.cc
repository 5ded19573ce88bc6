#include "pipeline/planning/make_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/placement.h"
#include "manifests/values/still_motion.h"
#include "manifests/values/text.h"
#include "manifests/values/weights.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/runtime/trace.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/frames/sources/frame_selection.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/frames/sources/still_clips.h"

namespace eventgan {
namespace {

struct Window {
  int first = 0;        // steps from the labelled frame to the previous frame
  int last = 0;         // ... to the next frame
  double position = 1;  // of the labelled frame within the pair
};

Window window(const PairSpec& spec, int gap) {
  if (spec.clip_frames) return spec.side == PairSide::kBefore ? Window{-1, 0, 1} : Window{0, 1, 0};
  if (spec.stills) return {0, 0, spec.side == PairSide::kBefore ? 1.0 : 0.0};
  switch (spec.side) {
    case PairSide::kBefore:
      return {-gap, 0, 1.0};
    case PairSide::kAfter:
      return {0, gap, 0.0};
    case PairSide::kAround:
      return {-gap / 2, gap / 2, 0.5};
  }
  return {};
}

struct Candidate {
  PairedFrame::State state = PairedFrame::State::kBeyond;
  PlannedSample sample;
};

/// Times are differences of large numbers: what the clock ticks off as 0.1 s may be a little more.
bool too_far_apart(const FramePair& pair, std::optional<double> max_gap_s) {
  constexpr double kTolerance_s = 1e-6;
  return max_gap_s && pair.gap_s() > *max_gap_s + kTolerance_s;  // false if a time is unknown
}

/// Where a labelled frame lies between the frames around it: where their times say. Half-way if
/// they say nothing, or hardly anything else: clocks tick unevenly.
double place_between(const FramePair& pair, double labelled_s) {
  constexpr double kUneven = 0.01;
  const double place = (labelled_s - pair.previous.time_s) / pair.gap_s();
  return place > 0 && place < 1 && std::abs(place - 0.5) > kUneven ? place : 0.5;
}

Candidate candidate(const Dataset& dataset, const LabelledFrame& frame, const PairSpec& spec,
                    int gap) {
  using State = PairedFrame::State;
  const Window place = window(spec, gap);
  const PairedFrame previous = dataset.paired_frame(frame, place.first);
  const PairedFrame next = dataset.paired_frame(frame, place.last);

  Candidate result;
  result.sample = {frame.sample_id,
                   frame.sequence,
                   frame.label_key,
                   {previous.frame, next.frame, gap, frame.frame.index, place.position},
                   ""};
  if (spec.side == PairSide::kAround && !spec.stills) {
    result.sample.pair.label_position = place_between(result.sample.pair, frame.frame.time_s);
  }
  if (too_far_apart(result.sample.pair, spec.max_gap_s)) return result;
  if (previous.state == State::kBeyond || next.state == State::kBeyond) return result;
  // What is wrong with the frame itself comes first: it may lie where it is not looked for.
  std::string& fault = result.sample.fault;
  fault = frame.fault;
  for (const PairedFrame* paired_frame : {&previous, &next}) {
    if (paired_frame->state == State::kMissing && fault.empty()) {
      fault = "expected a frame, got no file, in " + paired_frame->frame.path + " (" +
              frame.sample_id + ")";
    }
  }
  result.state = fault.empty() ? State::kPresent : State::kMissing;
  return result;
}

/// A still has no time before or after itself.
void forget_moved_time(FramePair& pair) {
  FrameRef& moved = pair.label_position == 1 ? pair.previous : pair.next;
  moved.time_s = std::numeric_limits<double>::quiet_NaN();
}

PairChoiceResult choose_one(const Dataset& dataset, const LabelledFrame& frame,
                            const SourceSpec& source, std::uint64_t seed, std::string_view key) {
  PairChoiceResult result;
  std::vector<PlannedSample> present;
  std::vector<PlannedSample> damaged;
  for (const int gap : source.pairs.gaps) {
    Candidate found = candidate(dataset, frame, source.pairs, gap);
    if (found.state == PairedFrame::State::kPresent) present.push_back(std::move(found.sample));
    if (found.state == PairedFrame::State::kMissing) damaged.push_back(std::move(found.sample));
    if (found.state == PairedFrame::State::kBeyond) result.unpaired.push_back(gap);
  }
  auto& choices = present.empty() ? damaged : present;
  if (choices.empty()) return result;
  const CounterRandom random =
      PairKey{seed, to_string(source.dataset), frame.sample_id, key}.pair();
  result.samples.push_back(std::move(choices[random.below(0, choices.size())]));
  if (source.pairs.stills && !source.pairs.clip_frames) {
    FramePair& pair = result.samples.back().pair;
    pair.motion = draw_motion(*source.pairs.stills, random);
    forget_moved_time(pair);
  }
  return result;
}

PairChoiceResult choose_all(const Dataset& dataset, const LabelledFrame& frame,
                            const SourceSpec& source) {
  PairChoiceResult result;
  for (const int gap : source.pairs.gaps) {
    Candidate found = candidate(dataset, frame, source.pairs, gap);
    if (found.state == PairedFrame::State::kBeyond) {
      result.unpaired.push_back(gap);
      continue;
    }
    found.sample.sample_id += "@" + std::string(to_string(source.pairs.side)) + std::to_string(gap);
    result.samples.push_back(std::move(found.sample));
  }
  return result;
}

PlannedSample window_of(const Dataset& dataset, const LabelledFrame& frame,
                        const SourceSpec& source) {
  // Flow is that of the image at the window's start.
  const double position = source.flow ? 0 : source.window.label == LabelPlace::kMiddle ? 0.5 : 1;
  return {frame.sample_id,
          frame.sequence,
          frame.label_key,
          {dataset.paired_frame(frame, -1).frame, dataset.paired_frame(frame, 1).frame, 0,
           frame.frame.index, position},
          frame.fault};
}

}  // namespace

PairChoiceResult choose_pairs(const Dataset& dataset, const LabelledFrame& frame,
                              const SourceSpec& source, std::uint64_t seed, std::string_view key) {
  if (has_events(source.dataset)) return {{window_of(dataset, frame, source)}, {}};
  return source.pairs.choose == PairChoice::kOne ? choose_one(dataset, frame, source, seed, key)
                                                 : choose_all(dataset, frame, source);
}

void renew_sample(const Dataset& dataset, const LabelledFrame& frame, const SourceSpec& source,
                  PlannedSample& sample) {
  const Window place =
      has_events(source.dataset) ? Window{-1, 1} : window(source.pairs, sample.pair.gap_frames);
  const auto renew = [&](FrameRef& planned, int steps) {
    const FrameRef today = dataset.paired_frame(frame, steps).frame;
    if (today == planned) planned.time_s = today.time_s;
  };
  renew(sample.pair.previous, place.first);
  renew(sample.pair.next, place.last);
  if (sample.pair.motion) forget_moved_time(sample.pair);
  sample.label_key = frame.label_key;
  if (sample.fault.empty()) sample.fault = frame.fault;
}

int samples_per_shard(const JobManifest& manifest, const SourceSpec& source, ImageSize size) {
  if (manifest.output.samples_per_shard) return *manifest.output.samples_per_shard;
  constexpr double kShard_s = 20;
  // Of one core; they err towards smaller shards. EventGAN in float32 (manifests/guides/speed.md),
  // simulators and cameras' events, and the cutting out of a photograph's objects.
  constexpr double kPerPixelAndWidth2_s = 2.4e-9, kPerPixel_s = 1e-7, kCutOut_s = 0.3;
  constexpr int kPublishedWidth = 32, kShippedWidth = 16;
  const GeneratorSpec& generator = manifest.generator;
  double per_pixel_s = kPerPixel_s;
  if (generator.kind == GeneratorKind::kNetwork) {
    const auto name = parse_weights_name(generator.weights);
    const bool is_file = !name || name->origin == WeightsOrigin::kFile;
    const double width =
        is_file ? kPublishedWidth : std::max(name->width.value_or(kShippedWidth), 8);
    per_pixel_s = kPerPixelAndWidth2_s * width * width;
  }
  const auto& stills = source.pairs.stills;
  const double sample_s = per_pixel_s * static_cast<double>(size.pixel_count()) +
                          (stills && stills->objects ? kCutOut_s : 0);
  return static_cast<int>(std::clamp(kShard_s / std::max(sample_s, 1e-9), 8.0, 64.0));
}

ShardLayout::ShardLayout(std::string name, SamplesPerShard samples_per_shard)
    : name_(std::move(name)), samples_per_shard_(std::move(samples_per_shard)) {}

void ShardLayout::begin_source(int source, const std::string& split) {
  end_source();
  source_ = source;
  split_ = split;
}

void ShardLayout::add(PlannedSample sample, ImageSize volume_size) {
  if (volume_size == ImageSize{}) {
    append_unknown(std::move(sample));
  } else {
    append(group(volume_size), std::move(sample));
  }
}

std::vector<PlannedShard> ShardLayout::finish() {
  end_source();
  std::map<std::string, std::size_t> totals;
  for (const std::string& split : splits_) ++totals[split];
  std::map<std::string, std::size_t> next;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    shards_[i].name = fmt::format("{}-{}-{:05}-of-{:05}.h5", name_, splits_[i], next[splits_[i]]++,
                                  totals[splits_[i]]);
  }
  splits_.clear();
  return std::exchange(shards_, {});
}

ShardLayout::Group& ShardLayout::group(ImageSize size) {
  const auto [entry, is_new] = group_index_.try_emplace({size.height, size.width}, groups_.size());
  if (is_new) {
    groups_.push_back({size, static_cast<std::size_t>(samples_per_shard_(source_, size))});
  }
  return groups_[entry->second];
}

void ShardLayout::append(Group& group, PlannedSample sample) {
  if (group.samples++ % group.samples_per_shard == 0) {
    group.shards.push_back({"", source_, group.size, {}});
  }
  group.shards.back().samples.push_back(std::move(sample));
}

void ShardLayout::append_unknown(PlannedSample sample) {
  const auto is_alike = [&](const PlannedSample& other) {
    const FrameRef &frame = sample.pair.next, &others = other.pair.next;
    const bool are_absent = frame.index < 0 && others.index < 0;
    return frame.path == others.path || (are_absent && sample.sequence == other.sequence);
  };
  const auto most = static_cast<std::size_t>(samples_per_shard_(source_, {}));
  const auto takes = [&](const PlannedShard& shard) {
    return shard.samples.size() < most && is_alike(shard.samples.back());
  };
  if (unknown_.empty() || !takes(unknown_.back())) {
    unknown_.push_back({"", source_, {}, {}, /*size_unknown=*/true});
  }
  unknown_.back().samples.push_back(std::move(sample));
}

ImageSize ShardLayout::most_common_size() const {
  if (groups_.empty()) return {1, 1};
  return std::ranges::max_element(groups_, {}, &Group::samples)->size;
}

void ShardLayout::end_source() {
  for (PlannedShard& shard : unknown_) shard.volume_size = most_common_size();
  for (Group& group : groups_) std::ranges::move(group.shards, std::back_inserter(shards_));
  std::ranges::move(unknown_, std::back_inserter(shards_));
  splits_.resize(shards_.size(), split_);
  groups_.clear();
  group_index_.clear();
  unknown_.clear();
}

namespace {

/// Sizes of images, each file asked once (a video serves thousands of samples): what labels ask for
/// later, too, the dataset keeps.
class SizeProbe {
 public:
  explicit SizeProbe(const JobManifest& manifest) : manifest_(manifest) {}

  /// {0, 0} if neither frame of the pair can be read.
  ImageSize volume_size(const SourceSpec& source, const Dataset& dataset,
                        const PlannedSample& sample) {
    if (manifest_.image.size) return *manifest_.image.size;
    if (has_events(source.dataset)) return dataset.sensor_size(sample.label_key);
    if (const auto made = dataset.made_size(sample.label_key)) return *made;
    const ImageOrientation orientation = orientation_of(source.dataset);
    ImageSizes& sizes = dataset.image_sizes() ? *dataset.image_sizes() : sizes_;
    for (const FrameRef* frame : {&sample.pair.next, &sample.pair.previous}) {
      if (frame->path.empty()) continue;
      const Outcome<ImageSize> size = sizes.of(resolve(manifest_, frame->path), orientation);
      if (!is_fault(size)) return *size;
    }
    return {};
  }

 private:
  const JobManifest& manifest_;
  ImageSizes sizes_;  ///< of the other datasets
};

/// Images of 16 bits become 8 by their upper ones: says so where these see little.
void note_narrow_values(const JobManifest& manifest, const SourceSpec& spec,
                        const std::vector<LabelledFrame>& frames, SourceSummary& summary) {
  if (manifest.image.range || has_events(spec.dataset)) return;
  const auto range = narrow_value_range(frames, manifest.directory);
  if (!range) return;
  summary.notes.push_back(fmt::format(
      "images of 16 bits use less than a quarter of their values, and of 16 bits the upper 8 are "
      "taken: \"image\": {{\"range\": [{}, {}]}} would spread them, in {}",
      range->low, range->high, spec.root));
}

/// Of objects that are to move on their own: how many have an outline, as far as some labels tell.
void note_outlines(const SourceSpec& spec, const Dataset& dataset,
                   const std::vector<LabelledFrame>& frames, SourceSummary& summary) {
  constexpr std::size_t kMostFrames = 200;
  if (!spec.pairs.stills || !spec.pairs.stills->objects || frames.empty()) return;
  const std::size_t looked_at = std::min(frames.size(), kMostFrames);
  std::int64_t boxes = 0, outlined = 0;
  for (std::size_t i = 0; i < looked_at; ++i) {
    const auto annotation =
        dataset.still_annotation(frames[i * frames.size() / looked_at].label_key);
    if (is_fault(annotation)) continue;
    for (const Box& box : annotation->boxes) {
      boxes += !box.ignore;
      outlined += !box.ignore && !box.outline.empty();
    }
  }
  const char* const others = boxes == 0         ? ": everything moves as the image does"
                             : boxes > outlined ? ", the others are cut out of their boxes"
                                                : "";
  summary.notes.push_back(
      fmt::format("objects move on their own: {} of {} (of {} looked at) have an outline{}, in {}",
                  outlined, count_text(boxes, "box"),
                  count_text(std::int64_t(looked_at), "labelled frame"), others, spec.root));
}

struct PlannedSource {
  SourceSummary summary;
  std::int64_t pairs = 0;
  std::map<int, std::int64_t> unpaired_by_gap;
};

/// Plans `most` pairs at most; then the source ends for it.
PlannedSource plan_source(const JobManifest& manifest, int index, const Dataset& dataset,
                          std::int64_t most, SizeProbe& probe, ShardLayout& layout,
                          const std::function<void()>& before_frame, const ShowPhase& show_phase) {
  const SourceSpec& spec = manifest.sources[index];
  const std::string key = source_key(manifest.sources, static_cast<std::size_t>(index));
  PlannedSource planned;
  SourceSummary& summary = planned.summary;
  layout.begin_source(index, spec.split);
  const auto [frames, selection_notes] =
      select_frames(dataset.labelled_frames(), spec, manifest.directory, manifest.seed);
  Phase phase(show_phase, {"frames", /*has_bytes=*/false, "planning"}, std::ssize(frames));
  for (const LabelledFrame& frame : frames) {
    if (planned.pairs == most) break;
    before_frame();
    ++summary.labelled_frames;
    phase.advance();
    PairChoiceResult chosen = choose_pairs(dataset, frame, spec, manifest.seed, key);
    for (const int gap : chosen.unpaired) ++planned.unpaired_by_gap[gap];
    const std::int64_t lost = spec.pairs.choose == PairChoice::kOne
                                  ? std::int64_t{chosen.samples.empty()}
                                  : std::ssize(chosen.unpaired);
    summary.unpaired += lost;
    if (lost > 0) summary.unpaired_ids.push_back(frame.sample_id);
    for (PlannedSample& sample : chosen.samples) {
      if (planned.pairs == most) break;
      ++planned.pairs;
      ++summary.pairs_by_gap[sample.pair.gap_frames];
      summary.faults += !sample.fault.empty();
      const ImageSize size = probe.volume_size(spec, dataset, sample);
      layout.add(std::move(sample), size);
    }
  }
  summary.notes = dataset.notes();
  note_narrow_values(manifest, spec, frames, summary);
  note_outlines(spec, dataset, frames, summary);
  if (const auto left_out = dataset.labelled_frames().size() - frames.size(); left_out > 0) {
    summary.notes.push_back(std::to_string(left_out) + " of " +
                            count_text(std::ssize(dataset.labelled_frames()), "labelled frame") +
                            " left out, as the manifest selects");
  }
  summary.notes.insert(summary.notes.end(), selection_notes.begin(), selection_notes.end());
  if (planned.pairs < std::min(spec.pairs.min_pairs, most)) {
    throw InputError("expected at least " + count_text(spec.pairs.min_pairs, "pair") +
                     " (pairs.min_pairs), got " + std::to_string(planned.pairs) + " of " +
                     count_text(summary.labelled_frames, "labelled frame") + ", in " + spec.root +
                     " ($.sources[" + std::to_string(index) + "])");
  }
  return planned;
}

/// Says of each source which samples' size is unknown: what becomes of them is worth a look before
/// anything is converted.
void note_unknown_sizes(Plan& plan) {
  struct Unknown {
    std::vector<std::string> samples;
    std::size_t shards = 0;
  };
  std::vector<Unknown> sources(plan.sources.size());
  for (const PlannedShard& shard : plan.shards) {
    if (!shard.size_unknown) continue;
    Unknown& unknown = sources[static_cast<std::size_t>(shard.source)];
    ++unknown.shards;
    for (const PlannedSample& sample : shard.samples) unknown.samples.push_back(sample.sample_id);
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const Unknown& unknown = sources[i];
    if (unknown.samples.empty()) continue;
    plan.sources[i].notes.push_back(
        count_text(std::ssize(unknown.samples), "sample") + " without a readable image (" +
        some_of(unknown.samples, 5) + "), so of unknown size: quarantined in " +
        std::to_string(unknown.shards) +
        (unknown.shards == 1 ? " shard of its own" : " shards of their own") +
        " until the images are repaired and eventgan retry has run");
  }
}

/// Says of each source how many pairs get noise for a time that is not their own.
void note_unknown_times(const GeneratorSpec& generator, Plan& plan) {
  if (!generator.noise) return;
  std::vector<std::int64_t> pairs(plan.sources.size());
  for (const PlannedShard& shard : plan.shards) {
    pairs[static_cast<std::size_t>(shard.source)] +=
        std::ranges::count_if(shard.samples, [](const PlannedSample& sample) {
          return !(sample.pair.gap_s() > 0);  // NaN, too
        });
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (pairs[i] == 0) continue;
    plan.sources[i].notes.push_back(
        fmt::format("no times of {}: their noise is that of duration_s, {:g} s",
                    count_text(pairs[i], "pair"), generator.duration_s));
  }
}

/// The labelled frame of a sample as the source has it today; null if it has none.
const LabelledFrame* frame_of(const Dataset& dataset, const SourceSpec& spec,
                              const PlannedSample& sample) {
  std::string_view id = sample.sample_id;
  if (spec.pairs.choose == PairChoice::kAll) id = id.substr(0, id.rfind('@'));
  const std::vector<LabelledFrame>& frames = dataset.labelled_frames();
  const auto found = std::ranges::lower_bound(frames, id, {}, &LabelledFrame::sample_id);
  return found != frames.end() && found->sample_id == id ? &*found : nullptr;
}

void fill_missing(const Dataset& dataset, const SourceSpec& spec, std::uint64_t seed,
                  std::string_view key, PlannedSample& missing) {
  const LabelledFrame* frame = frame_of(dataset, spec, missing);
  if (frame == nullptr) return;
  for (PlannedSample& sample : choose_pairs(dataset, *frame, spec, seed, key).samples) {
    if (sample.sample_id != missing.sample_id) continue;
    missing = std::move(sample);
    return;
  }
}

void settle_sizes(const JobManifest& manifest,
                  const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan) {
  SizeProbe probe(manifest);
  for (PlannedShard& shard : plan.shards) {
    if (!shard.size_unknown) continue;
    const auto source = static_cast<std::size_t>(shard.source);
    for (const PlannedSample& sample : shard.samples) {
      const ImageSize size = probe.volume_size(manifest.sources[source], *datasets[source], sample);
      if (size == ImageSize{}) continue;
      shard.volume_size = size;
      break;
    }
  }
}

constexpr char kLimitField[] = "limit";  // of a trial's fingerprint

/// Says what of a source cannot be read. Throws InputError where it is more than the job's error
/// policy allows.
void tell_unreadable(const JobManifest& manifest, const SourceSpec& source, const Dataset& dataset,
                     std::vector<std::string>& warnings) {
  const auto [reasons, of] = dataset.unreadable();
  if (reasons.empty()) return;
  // By the share alone: a recording is many samples.
  const ErrorSpec& errors = manifest.errors;
  const auto count = std::ssize(reasons);
  if (errors.policy == ErrorPolicy::kFail || count > errors.max_count ||
      double(count) > errors.max_fraction * double(of)) {
    throw InputError(fmt::format(
        "expected recordings that can be read, as \"errors\" in the manifest allows, got {} of {} "
        "that cannot, in {}:\n{}",
        reasons.size(), of, source.root, fmt::join(reasons, "\n")));
  }
  for (const std::string& reason : reasons) warnings.push_back("left out: " + reason);
}

/// Splits of one dataset tell apart what one program has written: a pixel, which nobody would see.
void warn_of_edges(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets,
                   std::vector<std::string>& warnings) {
  std::map<std::string, std::string> roots;  // a source of each beginning
  bool any_unset = false;
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    const std::optional<LabelSpec>& labels = manifest.sources[i].labels;
    if (!labels || labels->format != LabelFormat::kVoc) continue;
    const auto meanings = datasets[i]->label_meanings();
    const auto edges = meanings.find("edges_from");
    if (edges == meanings.end()) continue;
    roots.emplace(edges->second, manifest.sources[i].root);
    any_unset |= !labels->edges_from;
  }
  if (roots.size() < 2 || !any_unset) return;
  warnings.push_back(fmt::format(
      "edges count from {} in {} and from {} in {}: if one program has written both, "
      "give both \"edges_from\" in the manifest's labels",
      roots.begin()->first, roots.begin()->second, roots.rbegin()->first, roots.rbegin()->second));
}

void open_datasets(const JobManifest& manifest, const PlanningOptions& options,
                   std::vector<std::unique_ptr<Dataset>>& datasets) {
  Phase phase(options.show_phase, {"sources", /*has_bytes=*/false, "opening"},
              std::ssize(manifest.sources));
  for (const SourceSpec& source : manifest.sources) {
    TraceSpan span(options.trace, "open source", "job");
    span.note("root", source.root);
    datasets.push_back(open_dataset(source, manifest.directory));
    phase.advance();
  }
  make_clips(manifest, datasets);
  number_classes(manifest.sources, datasets);
}

}  // namespace

PlannedJob make_plan(const JobManifest& manifest, const std::string& weights_hash,
                     const std::string& engine, const PlanningOptions& options) {
  TraceSpan whole(options.trace, "make plan", "job");
  const auto stop_if_asked = [&] {
    if (options.stop && options.stop()) {
      throw Stopped("stopped while planning; nothing was written: run again");
    }
  };
  std::int64_t left = options.limit.value_or(std::numeric_limits<std::int64_t>::max());
  PlannedJob job;
  job.plan.name = manifest.name;
  job.plan.manifest_text = manifest.text;
  SizeProbe probe(manifest);
  ShardLayout layout(manifest.name, [&](int source, ImageSize size) {
    return samples_per_shard(manifest, manifest.sources[static_cast<std::size_t>(source)], size);
  });
  std::vector<std::string> annotation_files;
  std::map<std::string, std::string> meanings;  // of the labels, as fields of the fingerprint
  open_datasets(manifest, options, job.datasets);
  for (std::size_t i = 0; i < manifest.sources.size(); ++i) {
    TraceSpan span(options.trace, "plan source", "job");
    span.note("root", manifest.sources[i].root);
    const Dataset& dataset = *job.datasets[i];
    const auto sources_left = static_cast<std::int64_t>(manifest.sources.size() - i);
    const std::int64_t share = options.limit ? (left + sources_left - 1) / sources_left : left;
    PlannedSource planned = plan_source(manifest, static_cast<int>(i), dataset, share, probe,
                                        layout, stop_if_asked, options.show_phase);
    left -= planned.pairs;
    job.plan.sources.push_back(std::move(planned.summary));
    job.unpaired_by_gap.push_back(std::move(planned.unpaired_by_gap));
    std::ranges::move(dataset.warnings(), std::back_inserter(job.warnings));
    tell_unreadable(manifest, manifest.sources[i], dataset, job.warnings);
    for (auto& [what, meaning] : dataset.label_meanings()) {
      meanings["labels " + std::to_string(i) + " " + what] = meaning;
    }
    const auto files = dataset.annotation_files();
    annotation_files.insert(annotation_files.end(), files.begin(), files.end());
    if (const auto& ids = manifest.sources[i].selection.ids) annotation_files.push_back(*ids);
  }
  warn_of_edges(manifest, job.datasets, job.warnings);
  job.plan.shards = layout.finish();
  note_unknown_sizes(job.plan);
  note_unknown_times(manifest.generator, job.plan);
  whole.note("pairs", job.plan.sample_count());
  const TraceSpan span(options.trace, "fingerprint", "job");
  Phase phase(options.show_phase, {"files", /*has_bytes=*/false, "looking at"},
              std::ssize(annotation_files) + 2 * job.plan.sample_count());
  job.plan.fingerprint =
      make_fingerprint(manifest, job.plan, annotation_files, weights_hash, engine, [&] {
        stop_if_asked();
        phase.advance();
      });
  job.plan.fingerprint.merge(meanings);
  if (options.limit) job.plan.fingerprint[kLimitField] = std::to_string(*options.limit);
  return job;
}

std::optional<std::int64_t> limit_of(const std::map<std::string, std::string>& fingerprint) {
  const auto field = fingerprint.find(kLimitField);
  if (field == fingerprint.end()) return std::nullopt;
  std::int64_t limit = 0;
  std::from_chars(field->second.data(), field->second.data() + field->second.size(), limit);
  return limit;
}

void renew_samples(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan) {
  for (PlannedShard& shard : plan.shards) {
    const auto source = static_cast<std::size_t>(shard.source);
    if (!datasets[source]) continue;
    for (PlannedSample& sample : shard.samples) {
      const LabelledFrame* frame = frame_of(*datasets[source], manifest.sources[source], sample);
      if (frame != nullptr) {
        renew_sample(*datasets[source], *frame, manifest.sources[source], sample);
      } else {
        sample.fault = "expected the labelled frame that was planned, got none any more, in " +
                       sample.pair.next.path + " (" + sample.sample_id + ")";
      }
    }
  }
}

void complete_plan(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan) {
  for (PlannedShard& shard : plan.shards) {
    const auto source = static_cast<std::size_t>(shard.source);
    const std::string key = source_key(manifest.sources, source);
    for (PlannedSample& sample : shard.samples) {
      if (sample.fault.empty()) continue;
      fill_missing(*datasets[source], manifest.sources[source], manifest.seed, key, sample);
    }
  }
  renew_samples(manifest, datasets, plan);
  settle_sizes(manifest, datasets, plan);
}

}  // namespace eventgan

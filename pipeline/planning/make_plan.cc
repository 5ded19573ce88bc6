#include "pipeline/planning/make_plan.h"

#include <algorithm>
#include <string_view>
#include <unordered_map>

#include "manifests/faults.h"
#include "manifests/placement.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/planning/pair_choice.h"
#include "pipeline/planning/shard_layout.h"
#include "pipeline/profile/trace_span.h"
#include "stages/frames/decoding/image_size_probe.h"
#include "stages/frames/open_dataset.h"

namespace eventgan {
namespace {

/// Sizes of pictures, each file asked once (a video serves thousands of samples).
class SizeProbe {
 public:
  explicit SizeProbe(const JobManifest& manifest) : manifest_(manifest) {}

  /// {0, 0} if neither frame of the pair can be read.
  ImageSize volume_size(const PlannedSample& sample) {
    if (manifest_.image.size) return *manifest_.image.size;
    const ImageSize size = probe(sample.pair.next.path);
    return size == ImageSize{} ? probe(sample.pair.previous.path) : size;
  }

 private:
  ImageSize probe(const std::string& path) {
    const auto [entry, is_new] = sizes_.try_emplace(path);
    if (is_new && !path.empty()) {
      const Outcome<ImageSize> found = probe_image_size(resolve(manifest_, path));
      if (!is_fault(found)) entry->second = std::get<ImageSize>(found);
    }
    return entry->second;
  }

  const JobManifest& manifest_;
  std::unordered_map<std::string, ImageSize> sizes_;
};

SourceSummary plan_source(const JobManifest& manifest, int index, const Dataset& dataset,
                          SizeProbe& probe, ShardLayout& layout,
                          const std::function<void()>& before_frame) {
  const SourceSpec& spec = manifest.sources[index];
  SourceSummary summary;
  std::int64_t pairs = 0;
  layout.begin_source(index, spec.split);
  for (const LabelledFrame& frame : dataset.labelled_frames()) {
    before_frame();
    PairChoiceResult chosen = choose_pairs(dataset, frame, spec, manifest.seed);
    summary.without_partner += chosen.samples.empty() && spec.pairs.choose == PairChoice::kOne
                                   ? 1
                                   : static_cast<std::int64_t>(chosen.without_partner.size());
    if (!chosen.without_partner.empty()) summary.without_partner_ids.push_back(frame.sample_id);
    for (PlannedSample& sample : chosen.samples) {
      ++pairs;
      ++summary.pairs_by_gap[sample.pair.gap_frames];
      summary.faults += !sample.fault.empty();
      const ImageSize size = probe.volume_size(sample);
      layout.add(std::move(sample), size);
    }
  }
  summary.labelled_frames = static_cast<std::int64_t>(dataset.labelled_frames().size());
  summary.notes = dataset.notes();
  if (pairs < spec.pairs.min_pairs) {
    throw InputError("expected at least " + std::to_string(spec.pairs.min_pairs) +
                     " pairs (pairs.min_pairs), got " + std::to_string(pairs) + " of " +
                     std::to_string(summary.labelled_frames) + " labelled frames, in " + spec.root +
                     " ($.sources[" + std::to_string(index) + "])");
  }
  return summary;
}

/// Says of each source which samples' size is unknown: what becomes of them is worth a look before
/// anything is converted.
void note_unknown_sizes(Plan& plan) {
  constexpr std::size_t kNamed = 5;
  struct Unknown {
    std::size_t samples = 0;
    std::size_t shards = 0;
    std::string names;
  };
  std::vector<Unknown> sources(plan.sources.size());
  for (const PlannedShard& shard : plan.shards) {
    if (!shard.size_unknown) continue;
    Unknown& unknown = sources[static_cast<std::size_t>(shard.source)];
    ++unknown.shards;
    for (const PlannedSample& sample : shard.samples) {
      if (++unknown.samples <= kNamed) {
        unknown.names += (unknown.names.empty() ? "" : ", ") + sample.sample_id;
      }
    }
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const Unknown& unknown = sources[i];
    if (unknown.samples == 0) continue;
    plan.sources[i].notes.push_back(
        "planned without knowing the size of " + std::to_string(unknown.samples) +
        (unknown.samples == 1 ? " sample" : " samples") + ", no picture of which can be read (" +
        unknown.names + (unknown.samples > kNamed ? ", ..." : "") + "): quarantined in " +
        std::to_string(unknown.shards) +
        (unknown.shards == 1 ? " shard of its own" : " shards of their own") +
        " until the pictures are mended and eventgan retry has run");
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

void fill_hole(const Dataset& dataset, const SourceSpec& spec, std::uint64_t seed,
               PlannedSample& hole) {
  const LabelledFrame* frame = frame_of(dataset, spec, hole);
  if (frame == nullptr) return;
  for (PlannedSample& sample : choose_pairs(dataset, *frame, spec, seed).samples) {
    if (sample.sample_id != hole.sample_id) continue;
    hole = std::move(sample);
    return;
  }
}

void settle_sizes(const JobManifest& manifest, Plan& plan) {
  SizeProbe probe(manifest);
  for (PlannedShard& shard : plan.shards) {
    if (!shard.size_unknown) continue;
    for (const PlannedSample& sample : shard.samples) {
      const ImageSize size = probe.volume_size(sample);
      if (size == ImageSize{}) continue;
      shard.volume_size = size;
      break;
    }
  }
}

}  // namespace

PlannedJob make_plan(const JobManifest& manifest, const std::string& weights_hash,
                     const std::string& engine, const std::function<bool()>& stop,
                     TraceRecorder* trace) {
  TraceSpan whole(trace, "make plan", "job");
  const auto stop_if_asked = [&] {
    if (stop && stop()) throw Stopped("stopped while planning; nothing was written: run again");
  };
  PlannedJob job;
  job.plan.name = manifest.name;
  job.plan.manifest_text = manifest.text;
  SizeProbe probe(manifest);
  ShardLayout layout(manifest.name, manifest.output.samples_per_shard);
  std::vector<std::string> annotation_files;
  for (std::size_t i = 0; i < manifest.sources.size(); ++i) {
    TraceSpan span(trace, "plan source", "job");
    span.note("root", manifest.sources[i].root);
    const auto& dataset =
        job.datasets.emplace_back(open_dataset(manifest.sources[i], manifest.directory));
    job.plan.sources.push_back(
        plan_source(manifest, static_cast<int>(i), *dataset, probe, layout, stop_if_asked));
    const auto files = dataset->annotation_files();
    annotation_files.insert(annotation_files.end(), files.begin(), files.end());
  }
  job.plan.shards = layout.finish();
  note_unknown_sizes(job.plan);
  whole.note("pairs", job.plan.sample_count());
  const TraceSpan span(trace, "fingerprint", "job");
  job.plan.fingerprint =
      make_fingerprint(manifest, job.plan, annotation_files, weights_hash, engine, stop_if_asked);
  return job;
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
      } else if (sample.fault.empty()) {
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
    for (PlannedSample& sample : shard.samples) {
      if (sample.fault.empty()) continue;
      fill_hole(*datasets[source], manifest.sources[source], manifest.seed, sample);
    }
  }
  renew_samples(manifest, datasets, plan);
  settle_sizes(manifest, plan);
}

}  // namespace eventgan

#include "pipeline/conversion/plan_summary.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "manifests/documents/report.h"
#include "manifests/values/text.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/runtime/progress.h"
#include "stages/shards/codec/chunk_filters.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

struct Place {
  const PlannedShard* shard = nullptr;
  int slot = 0;
};

/// Of each source, samples without known faults and one more to warm up: up to four from its start,
/// since a video can only be decoded from there and neighbours share frames, and so cost what they
/// will in the run; or of stills, which share nothing and differ much, `most` spread over it.
std::vector<Place> places_to_try(const Plan& plan, int most) {
  constexpr int kNeighbours = 4;
  const auto first_count = static_cast<std::size_t>(1 + std::min(most, kNeighbours));
  const auto still_count = static_cast<std::size_t>(1 + most);
  std::map<int, std::vector<Place>> places, stills;  // by source
  for (const PlannedShard& shard : plan.shards) {
    for (std::size_t slot = 0; slot < shard.samples.size(); ++slot) {
      const PlannedSample& sample = shard.samples[slot];
      if (!sample.fault.empty()) continue;
      auto& of_source = (sample.pair.motion ? stills : places)[shard.source];
      if (!sample.pair.motion && of_source.size() == first_count) break;
      of_source.push_back({&shard, static_cast<int>(slot)});
    }
  }
  std::vector<Place> tried;
  for (const auto& [source, all] : stills) {
    const std::size_t count = std::min(still_count, all.size());
    for (std::size_t i = 0; i < count; ++i) tried.push_back(all[i * all.size() / count]);
  }
  for (const auto& [source, first] : places) tried.insert(tried.end(), first.begin(), first.end());
  return tried;
}

/// What some pairs cost together.
struct Cost {
  int pairs = 0;
  double seconds = 0;
  double bytes = 0;
  double pixels = 0;
};

/// What flow and its mask take in a shard, about: HDF5 shuffles and compresses them.
double stored_bytes(const PixelFlow& flow, int deflate_level) {
  std::vector<std::uint16_t> halves;
  halves.reserve(flow.px.size());
  for (const float px : flow.px) halves.push_back(half_of(px).bits);
  std::vector<std::byte> planes(2 * halves.size());
  split_into_planes(halves, planes.data(), halves.size());
  const auto mask = std::as_bytes(std::span(flow.valid));
  if (deflate_level == 0) return static_cast<double>(planes.size() + mask.size());
  Deflater deflater(std::max(deflate_level, 2));  // 1 codes runs of zeros alone, HDF5's does not
  const std::size_t of_px = deflater.deflate(planes).size();
  return static_cast<double>(of_px + deflater.deflate(mask).size());
}

SampleMessage run(const SampleStages& stages, const Place& place) {
  SampleMessage message;
  message.shard = place.shard;
  message.slot = place.slot;
  stages.read(message);
  stages.generate(message);
  stages.finish(message);
  return message;
}

}  // namespace

TrialEstimate measure_trial(const JobManifest& manifest, const PlannedJob& job,
                            const Generator& generator, int threads, int most) {
  const SampleStages stages(manifest, job.datasets, generator, 1);
  std::map<int, Cost> costs, first_costs;  // by source
  int warm_source = -1;
  for (const Place& place : places_to_try(job.plan, most)) {
    const SampleMessage message = run(stages, place);
    // In the first pair of a source libraries prepare, a video is opened.
    const int source = place.shard->source;
    const bool is_first = std::exchange(warm_source, source) != source;
    if (message.failed()) continue;
    Cost& cost = (is_first ? first_costs : costs)[source];
    ++cost.pairs;
    cost.seconds += std::accumulate(message.seconds.begin(), message.seconds.end(), 0.0);
    cost.bytes += static_cast<double>(message.chunk.size()) +
                  stored_bytes(message.sample.flow, manifest.output.deflate_level);
    cost.pixels += static_cast<double>(place.shard->volume_size.pixel_count());
  }
  costs.merge(first_costs);  // of sources no other pair of which could be tried
  TrialEstimate estimate;
  if (costs.empty()) return estimate;
  Cost all;
  for (const auto& [source, cost] : costs) {
    estimate.pairs_measured += cost.pairs;
    all.seconds += cost.seconds;
    all.bytes += cost.bytes;
    all.pixels += cost.pixels;
  }
  double seconds = 0;
  for (const PlannedShard& shard : job.plan.shards) {
    // A source none of whose pairs could be tried costs what the others do.
    const auto found = costs.find(shard.source);
    const Cost& cost = found == costs.end() ? all : found->second;
    const auto pixels = static_cast<double>(shard.volume_size.pixel_count() * shard.samples.size());
    seconds += cost.seconds / cost.pixels * pixels;
    estimate.stored_bytes += cost.bytes / cost.pixels * pixels;
  }
  estimate.seconds_per_pair = seconds / static_cast<double>(job.plan.sample_count());
  estimate.seconds = seconds / threads;
  return estimate;
}

namespace {

std::int64_t shards_of(const Plan& plan, int source) {
  return std::count_if(plan.shards.begin(), plan.shards.end(),
                       [&](const PlannedShard& shard) { return shard.source == source; });
}

std::int64_t pairs_of(const SourceSummary& summary) {
  std::int64_t pairs = 0;
  for (const auto& [gap, count] : summary.pairs_by_gap) pairs += count;
  return pairs;
}

/// "  (gap 1: 7, gap 2: 5)"; nothing where there is none.
std::string by_gap_text(const std::map<int, std::int64_t>& counts) {
  return counts.empty() ? "" : "  (" + counts_text(counts, "gap ") + ")";
}

std::string unpaired_text(const SourceSpec& spec, const SourceSummary& summary,
                          const std::map<int, std::int64_t>& by_gap) {
  std::int64_t places = 0;
  for (const auto& [gap, count] : by_gap) places += count;
  const std::string text =
      fmt::format("  no paired frame  {} of {} possible pairs (labelled frames x gaps){}\n", places,
                  summary.labelled_frames * std::ssize(spec.pairs.gaps), by_gap_text(by_gap));
  const std::vector<std::string>& ids = summary.unpaired_ids;
  if (ids.empty()) return text;
  const bool draws = spec.pairs.choose == PairChoice::kOne;
  return text + fmt::format("  {:<15}  {} of {}  ({})\n",
                            draws ? "no pair at all" : "lacking a gap", ids.size(),
                            count_text(summary.labelled_frames, "labelled frame"),
                            escape_controls(some_of(ids, 5)));
}

nlohmann::json by_gap_json(const std::map<int, std::int64_t>& counts) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [gap, count] : counts) json[std::to_string(gap)] = count;
  return json;
}

Report table_of(const SourceSpec& spec, const SourceSummary& summary,
                const std::map<int, std::int64_t>& unpaired, std::int64_t shards) {
  const bool is_of_frames = !has_events(spec.dataset);
  const std::int64_t pairs = pairs_of(summary);
  const auto of_frames = [&](const std::string& text) { return is_of_frames ? text : ""; };
  return {
      fmt::format("{} {} ({})", to_string(spec.dataset), escape_controls(spec.root),
                  escape_controls(spec.split)),
      {"dataset", to_string(spec.dataset)},
      {"root", spec.root},
      {"split", spec.split},
      of_frames(fmt::format("  {:<15}  {}",
                            has_labels(spec) ? "labelled frames" : "frames, NO LABELS",
                            summary.labelled_frames)),
      {"labelled_frames", summary.labelled_frames},
      is_of_frames
          ? fmt::format("  pairs            {}{}", pairs, by_gap_text(summary.pairs_by_gap))
          : fmt::format("  windows          {}", pairs),
      {"pairs", pairs},
      {"pairs_by_gap", by_gap_json(summary.pairs_by_gap)},
      of_frames(!spec.pairs.stills ? ""
                : spec.pairs.clip_frames
                    ? fmt::format("  clips of stills, {} frames each", *spec.pairs.clip_frames)
                    : fmt::format("  stills under a drawn motion: {}", pairs)),
      {"stills", spec.pairs.stills ? pairs : 0},
      is_of_frames && (!spec.pairs.stills || summary.unpaired > 0)
          ? unpaired_text(spec, summary, unpaired)
          : std::string(),
      {"unpaired", summary.unpaired},
      {"unpaired_by_gap", by_gap_json(unpaired)},
      {"unpaired_frames", summary.unpaired_ids.size()},
      {"unpaired_ids", summary.unpaired_ids},
      {"missing_frames", summary.faults,
       fmt::format("  to quarantine    {}  (a frame is missing inside the sequence, or a note says "
                   "why)",
                   summary.faults)},
      {"notes", summary.notes, listed(summary.notes, "  note: {}")},
      {"shards", shards},
      fmt::format("  shards           {}", shards)};
}

std::vector<Report> tables_of_sources(const JobManifest& manifest, const PlannedJob& job) {
  std::vector<Report> tables;
  for (std::size_t i = 0; i < job.plan.sources.size(); ++i) {
    tables.push_back(table_of(manifest.sources[i], job.plan.sources[i], job.unpaired_by_gap[i],
                              shards_of(job.plan, static_cast<int>(i))));
  }
  return tables;
}

std::string estimate_text(const TrialEstimate& estimate, int threads, Device device) {
  if (estimate.pairs_measured == 0)
    return "no pair could be measured: no estimate of size and time\n";
  return fmt::format(
      "about {} and {} with {} ({:.3f} s per pair on one thread, measured on {}{})\n",
      bytes_text(std::llround(estimate.stored_bytes)), duration_text(estimate.seconds, "dhms"),
      count_text(threads, "thread"), estimate.seconds_per_pair,
      count_text(estimate.pairs_measured, "pair"),
      device == Device::kCpu ? "" : " one by one; the device is faster in batches");
}

}  // namespace

std::string plan_text(const JobManifest& manifest, const PlannedJob& job,
                      const TrialEstimate& estimate, int threads) {
  const Plan& plan = job.plan;
  std::string text;
  for (const Report& source : tables_of_sources(manifest, job)) text += text_of(source);
  return text +
         fmt::format("total: {} in {}, ", count_text(plan.sample_count(), "pair"),
                     count_text(std::ssize(plan.shards), "shard")) +
         estimate_text(estimate, threads, manifest.generator.device);
}

std::string plan_summary_json(const JobManifest& manifest, const PlannedJob& job,
                              const TrialEstimate& estimate, int threads) {
  return json_text_of({{"name", job.plan.name},
                       {"sources", json_list(tables_of_sources(manifest, job), json_of)},
                       {"pairs", job.plan.sample_count()},
                       {"shards", job.plan.shards.size()},
                       {"threads", threads},
                       {"pairs_measured", estimate.pairs_measured},
                       {"seconds_per_pair", estimate.seconds_per_pair},
                       {"estimated_seconds", estimate.seconds},
                       {"estimated_bytes", estimate.stored_bytes}},
                      JsonLayout::kIndented);
}

}  // namespace eventgan

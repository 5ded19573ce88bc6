#include "pipeline/exports/detail/sample_events.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/generators.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/placement.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/runtime/errors.h"
#include "stages/events/event_volume.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/recordings/order/event_index.h"

namespace eventgan {
namespace {

constexpr char kWaysOut[] =
    " (run eventgan convert with the manifest again if recordings have moved; --counts draws events"
    " from the volumes, with --overwrite)";

/// Each event has a weight of 1 in its pixel's volume, in float32 of each bin.
bool is_sum(double sum, std::ptrdiff_t count) {
  constexpr double kRounding = 1e-5;
  return std::abs(sum - static_cast<double>(count)) <= 0.5 + kRounding * static_cast<double>(count);
}

}  // namespace

struct SampleEvents::Recordings {
  JobManifest manifest;
  std::vector<std::unique_ptr<Dataset>> datasets =
      {};  ///< of its sources; null: its split is not exported
  std::map<std::string, PlannedShard> shards = {};  ///< by name
};

SampleEvents::SampleEvents(const ExportInput& input, const ExportOptions& options)
    : input_(input), seed_(options.seed), counts_(options.counts) {
  if (!counts_ && !input.has_recordings()) counts_ = EventCounts::kPoisson;
}
SampleEvents::~SampleEvents() = default;

std::string SampleEvents::settings() const {
  if (!counts_) return "counts recorded\n";
  return *counts_ == EventCounts::kPoisson ? "counts poisson\n" : "counts rounded\n";
}

void SampleEvents::open() const {
  if (counts_) return;
  std::call_once(opened_, [&] {
    FrozenPlan frozen = read_frozen_plan(input_.folder());
    const std::filesystem::path base =
        recorded_manifest_folder(input_.folder()).value_or(input_.folder());
    Recordings recordings{parse_job_manifest(frozen.plan.manifest_text, base,
                                             (input_.folder() / "plan.json").string())};
    EventIndexes indexes(input_.folder() / kEventIndexFile);
    for (const SourceSpec& source : recordings.manifest.sources) {
      if (std::ranges::find(input_.splits(), source.split) == input_.splits().end()) {
        recordings.datasets.push_back(nullptr);
        continue;
      }
      try {
        recordings.datasets.push_back(open_dataset(source, base));
      } catch (const std::exception& error) {
        throw InputError(error_line(error) + kWaysOut);
      }
    }
    for (PlannedShard& shard : frozen.plan.shards) {
      recordings.shards.emplace(shard.name, std::move(shard));
    }
    recordings_ = std::make_unique<const Recordings>(std::move(recordings));
  });
}

std::vector<Event> SampleEvents::recorded(const OutgoingSample& sample) const {
  open();
  const ShardSample& stored = sample.labels;
  const PlannedShard& shard = recordings_->shards.at(sample.shard.outline.name);
  const PlannedSample& planned = shard.samples.at(static_cast<std::size_t>(sample.slot));
  const Dataset& dataset = *recordings_->datasets.at(static_cast<std::size_t>(shard.source));
  const auto fail = [&](const std::string& what) {
    throw InputError(
        fmt::format("{}, in {} ({}){}", what, planned.pair.next.path, stored.sample_id, kWaysOut));
  };
  Outcome<EventWindow> window = dataset.events(planned.label_key);
  if (is_fault(window)) {
    throw InputError(fmt::format("{} ({}){}", window.fault().reason, stored.sample_id, kWaysOut));
  }
  if (window->sensor != stored.source_size) {
    fail(fmt::format("expected a sensor of {}, as when it was converted, got {}",
                     to_string(stored.source_size), to_string(window->sensor)));
  }
  std::vector<Event> events = std::move(window->events);
  place_events(place(window->sensor, recordings_->manifest.image), events);
  const auto positive = std::ranges::count_if(events, &Event::positive);
  const auto negative = std::ssize(events) - positive;
  const VolumeStatistics& sums = stored.statistics;
  if (!is_sum(sums.sum_positive, positive) || !is_sum(sums.sum_negative, negative)) {
    fail(
        fmt::format("expected {:.0f} positive and {:.0f} negative events, of which the volume is "
                    "made, got {} and {}",
                    sums.sum_positive, sums.sum_negative, positive, negative));
  }
  for (Event& event : events) event.t_s -= stored.pair.previous.time_s;
  return events;
}

std::vector<Event> SampleEvents::of(const OutgoingSample& sample, double duration_s) const {
  if (!counts_) return recorded(sample);
  const PairKey key{seed_, sample.source.dataset, sample.labels.sample_id, sample.source.key};
  try {
    return sample_events(sample.reader.volume(sample.slot), sample.reader.header().volume,
                         duration_s, *counts_, key.pair());
  } catch (const UsageError& error) {
    throw UsageError(fmt::format("{}, in {} ({})", error.what(),
                                 (input_.folder() / sample.shard.outline.name).string(),
                                 sample.labels.sample_id));
  }
}

double known_gap_s(const FramePair& pair) {
  const double gap_s = pair.gap_s();
  return gap_s > 0 ? gap_s : 1;
}

}  // namespace eventgan

#include "pipeline/report/survey.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "manifests/values/counter_random.h"
#include "pipeline/folder/folder_status.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/preview/preview.h"
#include "stages/events/event_places.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {

void LogHistogram::add(double value) {
  if (!(value > 0)) {
    ++zeros;
    return;
  }
  const double bin = std::floor((std::log10(value) - kFirstDecade) * kPerDecade);
  ++counts[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(counts.size() - 1)))];
}

double LogHistogram::edge(int bin) {
  return std::pow(10.0, kFirstDecade + static_cast<double>(bin) / kPerDecade);
}

namespace {

namespace fs = std::filesystem;

/// The `most` samples that rank highest; equals by place, so that the order of reading is no
/// matter.
class Best {
 public:
  explicit Best(std::size_t most) : most_(most) {}

  void offer(double rank, PickedSample sample) {
    const auto key = std::make_pair(-rank, sample.shard + "#" + std::to_string(sample.slot));
    if (samples_.size() == most_ && !(key < samples_.rbegin()->first)) return;
    samples_.emplace(key, std::move(sample));
    if (samples_.size() > most_) samples_.erase(std::prev(samples_.end()));
  }

  std::vector<PickedSample> take() const {
    std::vector<PickedSample> taken;
    for (const auto& [key, sample] : samples_) taken.push_back(sample);
    // Frames of videos are decoded from the start on, so going back is slow.
    std::ranges::sort(taken, {}, [](const PickedSample& s) { return std::pair(s.shard, s.slot); });
    return taken;
  }

 private:
  std::size_t most_;
  std::map<std::pair<double, std::string>, PickedSample> samples_;
};

/// What is picked of a source while its shards are read.
struct Picks {
  explicit Picks(std::size_t random) : random_ones(random) {}
  Best random_ones;
  Best emptiest{1}, fullest{1}, extrapolated{1};

  std::vector<PickedSample> take() const {
    std::vector<PickedSample> all;
    for (const Best* best : {&random_ones, &emptiest, &fullest, &extrapolated}) {
      for (PickedSample& sample : best->take()) {
        const auto same = std::ranges::find_if(all, [&](const PickedSample& other) {
          return other.shard == sample.shard && other.slot == sample.slot;
        });
        if (same == all.end()) {
          all.push_back(std::move(sample));
        } else {
          same->why += ", " + sample.why;
        }
      }
    }
    return all;
  }
};

class Surveyor {
 public:
  Surveyor(const fs::path& folder, DatasetParts parts)
      : folder_(folder), random_(CounterRandom(parts.manifest.seed).keyed("report")) {
    survey_.parts = std::move(parts);
    survey_.sources.resize(survey_.parts.manifest.sources.size());
    survey_.header = survey_.parts.headers.begin()->second;
    std::set<int> with_shards;
    for (const ShardState& shard : survey_.parts.done) with_shards.insert(shard.outline.source);
    const std::size_t shown = std::min<std::size_t>(with_shards.size(), Survey::kShownSources);
    const std::size_t random = std::clamp<std::size_t>(12 / shown, 2, 6);
    for (const int source : with_shards) {
      if (picks_.size() < shown) picks_.emplace(source, Picks(random));
    }
  }

  Survey run() {
    for (const ShardState& shard : survey_.parts.done) {
      add_commit_record(shard);
      renew_time_limit();
      add_overview(shard, read_overview(folder_ / shard.outline.name));
      lift_time_limit();
    }
    for (const auto& [source, picks] : picks_) {
      survey_.sources[static_cast<std::size_t>(source)].picked = picks.take();
    }
    read_volumes();
    return std::move(survey_);
  }

 private:
  SourceSurvey& source_of(const ShardState& shard) {
    return survey_.sources.at(static_cast<std::size_t>(shard.outline.source));
  }

  void add_commit_record(const ShardState& shard) {
    const CommitRecord& record = *shard.record;
    const SourceSpec& spec = survey_.parts.source_of(shard.outline);
    for (DatasetCounts* counts :
         {&survey_.counts, &source_of(shard).counts, &survey_.splits[spec.split],
          &survey_.datasets[std::string(to_string(spec.dataset))]}) {
      add(record, *counts);
    }
    for (const QuarantinedSample& sample : record.quarantined) {
      QuarantinedSlot slot{record.shard, sample.slot, sample.sample_id, sample.reason};
      FaultSurvey& fault = survey_.faults[fault_kind(sample.reason)];
      if (fault.samples++ == 0) fault.first = slot;
      if (survey_.quarantined.size() < Survey::kMostQuarantined) {
        survey_.quarantined.push_back(std::move(slot));
      }
    }
    for (const auto& [stage, seconds] : record.stage_seconds) {
      survey_.stage_seconds[stage] += seconds;
    }
    survey_.wall_seconds += record.wall_seconds;
    survey_.peak_bytes = std::max(survey_.peak_bytes, record.peak_bytes);
  }

  void add_overview(const ShardState& shard, const ShardOverview& overview) {
    const ShardTables& tables = overview.tables;
    const auto pixels = static_cast<double>(overview.header.volume.size.pixel_count());
    for (std::size_t i = 0; i < tables.valid.size(); ++i) {
      GapSurvey& gap = survey_.gaps[tables.pairs.gap_frames[i]];
      ++gap.samples;
      if (const double seconds = tables.pairs.gap_s[i]; std::isfinite(seconds)) {
        gap.least_s = std::min(gap.least_s.value_or(seconds), seconds);
        gap.most_s = std::max(gap.most_s.value_or(seconds), seconds);
      }
      if (tables.valid[i] == 0) continue;
      const std::uint32_t flags = tables.events.flags[i];
      if ((flags & kFlagExtrapolated) != 0) ++gap.extrapolated;
      for (const std::string& flag : flag_names(flags)) ++survey_.flags[flag];
      source_of(shard).events_per_pixel.add(
          (tables.events.sum_positive[i] + tables.events.sum_negative[i]) / pixels);
      offer(shard, overview, static_cast<int>(i));
    }
    for (std::size_t box = 0; box < tables.boxes.class_id.size(); ++box) {
      if (tables.boxes.ignore[box] != 0) continue;
      const double* xyxy = &tables.boxes.xyxy[4 * box];
      const double width = std::max(0.0, xyxy[2] - xyxy[0]);
      const double height = std::max(0.0, xyxy[3] - xyxy[1]);
      survey_.box_sides.add(std::sqrt(width * height));
      if (std::min(width, height) < Survey::kNarrowPx) {
        const auto id = static_cast<std::size_t>(tables.boxes.class_id[box]);
        ++survey_.narrow_boxes[overview.header.label_schema.class_names.at(id)];
      }
    }
  }

  void offer(const ShardState& shard, const ShardOverview& overview, int slot) {
    const std::string& id = overview.tables.pairs.sample_id[static_cast<std::size_t>(slot)];
    // A number of its own for each sample, whatever else there is: the largest ones are a draw.
    const double draw = random_.keyed(id).uniform(static_cast<std::uint64_t>(shard.outline.source));
    drawn_.offer(draw, {"", shard.outline.name, slot, id});
    const auto picks = picks_.find(shard.outline.source);
    if (picks == picks_.end()) return;
    picks->second.random_ones.offer(draw, {"random", shard.outline.name, slot, id});
    const auto extreme = [&](Best& best, Extreme kind, const char* why) {
      const auto ranked = rank(kind, overview, slot);
      if (ranked) best.offer(*ranked, {why, shard.outline.name, slot, id});
    };
    extreme(picks->second.emptiest, Extreme::kEmptiest, "emptiest");
    extreme(picks->second.fullest, Extreme::kFullest, "fullest");
    extreme(picks->second.extrapolated, Extreme::kExtrapolated, "farthest beyond the trained gaps");
  }

  void read_volumes() {
    std::map<std::string, std::vector<int>> slots;  // by shard, so that each is opened once
    for (const PickedSample& sample : drawn_.take()) slots[sample.shard].push_back(sample.slot);
    for (const auto& [shard, chosen] : slots) {
      renew_time_limit();
      const ShardReader reader(folder_ / shard);
      for (const int slot : chosen) {
        renew_time_limit();
        add_volume(reader.header(), reader.sample(slot), reader.volume(slot));
      }
      lift_time_limit();
    }
    for (std::vector<double>* bins : {&survey_.positive_bins, &survey_.negative_bins}) {
      for (double& value : *bins) value /= survey_.volumes;
    }
  }

  void add_volume(const ShardHeader& header, const ShardSample& sample,
                  const std::vector<float>& volume) {
    const VolumeShape& shape = header.volume;
    const auto bins = static_cast<std::size_t>(shape.bins);
    survey_.positive_bins.resize(bins);
    survey_.negative_bins.resize(bins);
    const std::vector<double> sums = channel_sums(volume, shape);
    for (std::size_t bin = 0; bin < bins; ++bin) {
      const auto pixels = static_cast<double>(shape.size.pixel_count());
      survey_.positive_bins[bin] += sums[bin] / pixels;
      survey_.negative_bins[bin] += sums[bins + bin] / pixels;
    }
    ++survey_.volumes;

    const std::vector<std::uint8_t> mask = event_mask(volume, shape, Survey::kEventSum);
    const auto count = [](std::map<std::string, LabelSurvey>& labels, const std::string& name,
                          bool has_events) {
      ++labels[name].looked_at;
      labels[name].without_events += has_events ? 0 : 1;
    };
    for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
      const VolumeBox& box = sample.labels.boxes[i];
      const auto share = share_inside(mask, shape.size, box.clipped);
      if (box.ignore || !share) continue;
      const auto id = static_cast<std::size_t>(sample.annotation.boxes[i].class_id);
      count(survey_.classes, header.label_schema.class_names.at(id), *share >= Survey::kBoxShare);
    }
    for (const VolumePerson& person : sample.labels.persons) {
      for (std::size_t j = 0; j < person.joints.size(); ++j) {
        if (person.joints[j] == kMissingPoint) continue;
        const auto near = is_set_near(mask, shape.size, person.joints[j], Survey::kJointRadius);
        if (near) count(survey_.joints, header.label_schema.joint_names.at(j), *near);
      }
    }
  }

  const fs::path& folder_;
  CounterRandom random_;
  Survey survey_;
  std::map<int, Picks> picks_;  // by source
  Best drawn_{Survey::kMostVolumes};
};

}  // namespace

Survey survey_folder(const fs::path& folder) {
  return Surveyor(folder, read_dataset_parts(folder)).run();
}

}  // namespace eventgan

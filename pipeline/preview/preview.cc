#include "pipeline/preview/preview.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "pipeline/dataset/shown_samples.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/planning/spread.h"
#include "pipeline/preview/preview_reader.h"
#include "stages/base/videos/video_file.h"
#include "stages/events/images/image_output.h"
#include "stages/events/images/preview_image.h"
#include "stages/frames/listing/image_folder.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse_slots(const std::string& text, int sample_count) {
  throw UsageError("--samples: expected slots 0.." + std::to_string(sample_count - 1) +
                   " such as 0,3-5, got \"" + text + "\"");
}

}  // namespace

std::vector<int> parse_slots(const std::string& text, int sample_count) {
  std::set<int> slots;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&] {
    int value = -1;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || value < 0 || value >= sample_count)
      refuse_slots(text, sample_count);
    at = next;
    return value;
  };
  while (true) {
    const int first = number();
    int last = first;
    if (at != end && *at == '-') {
      ++at;
      last = number();
    }
    if (last < first) refuse_slots(text, sample_count);
    for (int slot = first; slot <= last; ++slot) slots.insert(slot);
    if (at == end) break;
    if (*at++ != ',') refuse_slots(text, sample_count);
  }
  return {slots.begin(), slots.end()};
}

std::optional<double> rank(Extreme extreme, const ShardOverview& shard, int slot) {
  const auto at = static_cast<std::size_t>(slot);
  const EventColumns& events = shard.tables.events;
  if (shard.tables.valid[at] == 0) return std::nullopt;
  const double sum = (events.sum_positive[at] + events.sum_negative[at]) /
                     static_cast<double>(shard.header.volume.size.pixel_count());
  switch (extreme) {
    case Extreme::kEmptiest:
      return -sum;
    case Extreme::kFullest:
      return sum;
    case Extreme::kExtrapolated:
      if ((events.flags[at] & (kFlagExtrapolated | kFlagBeyondCalibration)) == 0) break;
      return shard.tables.pairs.gap_frames[at];
  }
  return std::nullopt;
}

namespace {

ShardOverview overview_of(const ShownShards& shards, std::size_t shard) {
  renew_time_limit();
  ShardOverview overview = read_overview(shards.files[shard]);
  lift_time_limit();
  return overview;
}

bool has_box_of(const std::string& class_name, const ShardOverview& shard, int slot) {
  const auto& names = shard.header.label_schema.class_names;
  const BoxColumns& boxes = shard.tables.boxes;
  const auto at = static_cast<std::size_t>(slot);
  for (auto box = static_cast<std::size_t>(boxes.offsets[at]);
       box < static_cast<std::size_t>(boxes.offsets[at + 1]); ++box) {
    const auto id = static_cast<std::size_t>(boxes.class_id[box]);
    if (boxes.ignore[box] == 0 && id < names.size() && names[id] == class_name) return true;
  }
  return false;
}

/// Calls visit(place, overview) for every sample that `options` leaves to choose from.
template <class Visit>
void visit_samples(const ShownShards& shards, const PreviewOptions& options, Visit&& visit) {
  std::set<std::string> known;
  bool any = false;
  for (std::size_t i = 0; i < shards.files.size(); ++i) {
    const ShardOverview overview = overview_of(shards, i);
    const auto& names = overview.header.label_schema.class_names;
    known.insert(names.begin(), names.end());
    for (int slot = 0; slot < overview.header.sample_count; ++slot) {
      if (!options.class_name.empty() && !has_box_of(options.class_name, overview, slot)) continue;
      any = true;
      visit(ShownSample{i, slot}, overview);
    }
  }
  if (any || options.class_name.empty()) return;
  throw UsageError(fmt::format(
      "--class: expected a class of the boxes ({}), got \"{}\"",
      known.empty() ? "none of the samples has boxes" : fmt::format("{}", fmt::join(known, ", ")),
      options.class_name));
}

std::vector<ShownSample> worst_samples(const ShownShards& shards, const PreviewOptions& options) {
  std::map<Extreme, std::set<std::pair<double, ShownSample>>> best;  // the least extreme first
  visit_samples(shards, options, [&](ShownSample place, const ShardOverview& overview) {
    for (const Extreme extreme : {Extreme::kEmptiest, Extreme::kFullest, Extreme::kExtrapolated}) {
      const auto ranked = rank(extreme, overview, place.slot);
      if (!ranked) continue;
      best[extreme].emplace(*ranked, place);
      if (std::ssize(best[extreme]) > options.worst) best[extreme].erase(best[extreme].begin());
    }
  });
  std::vector<ShownSample> chosen;
  for (const auto& [extreme, samples] : best) {
    for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample) {
      if (std::ranges::find(chosen, sample->second) == chosen.end()) {
        chosen.push_back(sample->second);
      }
    }
  }
  return chosen;
}

std::vector<ShownSample> choose(const ShownShards& shards, const PreviewOptions& options) {
  if (!options.slots.empty()) {
    if (shards.is_folder) {
      throw UsageError("--samples: expected one shard, got the folder " + shards.folder.string() +
                       " (use --sample ID)");
    }
    std::vector<ShownSample> chosen;
    for (const int slot : parse_slots(options.slots, shards.samples[0])) {
      chosen.push_back({0, slot});
    }
    return chosen;
  }
  if (!options.samples.empty()) return find_samples(shards, options.samples);
  if (options.worst > 0) return worst_samples(shards, options);
  constexpr int kImages = 8, kTiles = 24;
  const int count = options.count.value_or(options.sheet ? kTiles : kImages);
  std::vector<ShownSample> all;
  if (!options.class_name.empty()) {
    visit_samples(shards, options, [&](ShownSample place, const auto&) { all.push_back(place); });
  } else {
    for (std::size_t i = 0; i < shards.files.size(); ++i) {
      for (int slot = 0; slot < shards.samples[i]; ++slot) all.push_back({i, slot});
    }
  }
  std::vector<ShownSample> chosen;
  for (const std::size_t at : spread(static_cast<std::size_t>(count), all.size())) {
    chosen.push_back(all[at]);
  }
  return chosen;
}

/// The sequence's samples in order, and how fast they go.
struct Sequence {
  std::string name;
  std::vector<ShownSample> samples;
  double frames_per_second = 10;  ///< where the dataset tells no times
};

/// Source and name.
using SequenceKey = std::pair<int, std::string>;

SequenceKey sequence_of(const ShownShards& shards, ShownSample place,
                        const ShardOverview& overview) {
  return {shards.sources[place.shard],
          overview.tables.pairs.sequence[static_cast<std::size_t>(place.slot)]};
}

SequenceKey wanted_sequence(const ShownShards& shards, const PreviewOptions& options) {
  if (!options.slots.empty() || !options.samples.empty()) {
    const ShownSample first = choose(shards, options).front();
    return sequence_of(shards, first, overview_of(shards, first.shard));
  }
  std::map<SequenceKey, int> lengths;
  visit_samples(shards, options, [&](ShownSample place, const ShardOverview& overview) {
    ++lengths[sequence_of(shards, place, overview)];
  });
  return std::ranges::max_element(lengths, {}, [](const auto& entry) { return entry.second; })
      ->first;
}

Sequence read_sequence(const ShownShards& shards, const PreviewOptions& options) {
  struct Frame {
    ShownSample place;
    int gap = 0;
    double seconds_a_frame = 0;
  };
  const SequenceKey key = wanted_sequence(shards, options);
  std::map<std::int64_t, Frame> frames;  // by the labelled frame's number
  for (std::size_t i = 0; i < shards.files.size(); ++i) {
    if (shards.sources[i] != key.first) continue;
    const ShardOverview overview = overview_of(shards, i);
    const PairColumns& pairs = overview.tables.pairs;
    for (std::size_t slot = 0; slot < pairs.sequence.size(); ++slot) {
      if (pairs.sequence[slot] != key.second) continue;
      const int gap = pairs.gap_frames[slot];
      const auto [known, is_new] = frames.try_emplace(pairs.label_index[slot]);
      if (is_new || gap < known->second.gap) {
        known->second = {{i, static_cast<int>(slot)}, gap, pairs.gap_s[slot] / std::max(gap, 1)};
      }
    }
  }
  Sequence sequence{key.second, {}};
  std::vector<double> steps;
  for (const auto& [index, frame] : frames) {
    sequence.samples.push_back(frame.place);
    if (std::isfinite(frame.seconds_a_frame)) steps.push_back(frame.seconds_a_frame);
  }
  if (!steps.empty()) {
    std::nth_element(steps.begin(), steps.begin() + std::ssize(steps) / 2, steps.end());
    sequence.frames_per_second = std::clamp(1 / steps[steps.size() / 2], 1.0, 60.0);
  }
  return sequence;
}

std::string image_name(const fs::path& shard, int slot) {
  std::string number = std::to_string(slot);
  number.insert(0, 4 - std::min<std::size_t>(number.size(), 4), '0');
  return shard.stem().string() + "_" + number + ".png";
}

/// A sequence's name as that of a file.
std::string file_name(std::string sequence) {
  if (sequence.empty()) return "sequence";
  std::ranges::replace(sequence, '/', '_');
  return sequence;
}

}  // namespace

std::vector<fs::path> preview(const fs::path& where, const PreviewOptions& options,
                              std::vector<std::string>& warnings) {
  const ShownShards shards = find_shown_shards(where);
  const fs::path frames = !options.frames.empty()
                              ? fs::absolute(options.frames)
                              : recorded_manifest_folder(shards.folder).value_or(shards.folder);
  PreviewReader reader(frames, warnings);
  const auto content = [&](ShownSample place) {
    return reader.content(shards.files[place.shard], place.slot);
  };
  if (options.video) {
    const Sequence sequence = read_sequence(shards, options);
    const fs::path video = options.out / (file_name(sequence.name) + ".mp4");
    require_replaceable(video, OwnFile::kVideo);
    require_no_images(options.out);
    fs::create_directories(options.out);
    auto sample = sequence.samples.begin();
    write_video(video, sequence.frames_per_second, [&]() -> std::optional<ColourFrame> {
      if (sample == sequence.samples.end()) return std::nullopt;
      return draw_preview(content(*sample++));
    });
    return {video};
  }
  const std::vector<ShownSample> chosen = choose(shards, options);
  if (chosen.empty()) {
    throw InputError("expected a valid sample, got none, in " + where.string());
  }
  std::vector<fs::path> images;
  for (const ShownSample& place : chosen) {
    images.push_back(options.out / image_name(shards.files[place.shard], place.slot));
  }
  if (options.sheet) images = {options.out / "sheet.png"};
  for (const fs::path& image : images) require_replaceable(image, OwnFile::kPicture);
  require_no_images(options.out);
  fs::create_directories(options.out);
  if (options.sheet) {
    constexpr int kColumns = 3, kTileWidth = 400;
    std::vector<ColourFrame> tiles;
    for (const ShownSample& place : chosen) tiles.push_back(draw_tile(content(place), kTileWidth));
    write_png(draw_sheet(tiles, kColumns), images.back());
    return images;
  }
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    write_png(draw_preview(content(chosen[i])), images[i]);
  }
  return images;
}

}  // namespace eventgan

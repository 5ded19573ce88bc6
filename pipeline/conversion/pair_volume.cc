#include "pipeline/conversion/pair_volume.h"

#include <algorithm>
#include <cmath>

#include "manifests/values/generators.h"
#include "stages/events/drawn_events.h"
#include "stages/events/noise.h"
#include "stages/events/simulation/sensor.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/wanted_tiles.h"

namespace eventgan {
namespace {

/// Whether the sensor gives events although nothing moves.
bool has_events_at_rest(const GeneratorSpec& spec) {
  return generator_row(spec.kind).has_sensor_settings &&
         idle_event_bytes(spec.sensor, 1, spec.duration_s) > 0;
}

bool is_same_image(const PreparedPair& pair) {
  const auto next = pair.input.begin() + static_cast<std::ptrdiff_t>(pair.content.pixel_count());
  return std::equal(next, pair.input.end(), pair.input.begin());
}

}  // namespace

GeneratedPart generate_volume(const Generator& generator, const GeneratorSpec& spec,
                              const PairKey& key, const PreparedPair& pair,
                              const VolumeLabels& labels, std::span<float> volume) {
  GeneratedPart part;
  part.threshold = pair_threshold(spec, key);
  TileMask wanted;
  if (spec.scope.scope != Scope::kWhole) {
    wanted =
        wanted_tiles(spec.scope, pair.input, pair.content, pair.content_y, pair.content_x, labels);
    part.tiles = tiles_of_volume(wanted, pair.content_y, pair.content_x, pair.placement.volume);
  }
  const bool rests = pair.between.at && pair.between.displacement_px == 0;
  part.same_image = (rests || !generator_row(spec.kind).moves_one_frame) && is_same_image(pair);
  if (part.same_image && !has_events_at_rest(spec)) {
    std::ranges::fill(volume, 0.0f);
    part.notes.sound = true;
    return part;
  }
  const GeneratorInput input{pair.input, pair.content, part.threshold,
                             pair.between.at ? &pair.between : nullptr, key.draw};
  part.notes = spec.scope.scope == Scope::kWhole ? generator.generate(input, volume)
                                                 : generator.generate_tiles(input, wanted, volume);
  if (spec.sample && generator.thresholds()) {
    draw_events(volume, {generator.bins(), pair.content}, key.pair().keyed("events"));
  }
  return part;
}

bool add_pair_noise(const GeneratorSpec& spec, const PairKey& key, double gap_s,
                    const VolumeShape& content, std::span<float> volume) {
  if (!spec.noise) return false;
  const double duration_s = gap_s > 0 && std::isfinite(gap_s) ? gap_s : spec.duration_s;
  const NoiseRandom random{key.camera().keyed("hot pixels"), key.pair().keyed("noise")};
  return add_noise(*spec.noise, duration_s, content, random, volume) > 0;
}

std::optional<VolumeStatistics> finish_volume(const Generator& generator,
                                              const GenerationNotes& notes, int gap_frames,
                                              Normalization normalization, const PreparedPair& pair,
                                              std::span<float> volume) {
  std::optional<VolumeStatistics> statistics =
      volume_statistics(volume, {generator.bins(), pair.placement.volume});
  if (!statistics) return statistics;
  const std::optional<GapRange> trained = generator.training_gaps();
  if (trained && !trained->contains(gap_frames)) statistics->flags |= kFlagExtrapolated;
  if (notes.saturated_share > kMostSaturated) statistics->flags |= kFlagBeyondCalibration;
  if (normalization == Normalization::kEta98) normalize(volume, statistics->eta98);
  return statistics;
}

}  // namespace eventgan

#include "pipeline/conversion/pair_volume.h"

#include <cmath>

#include "stages/events/drawn_events.h"
#include "stages/events/noise.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/wanted_tiles.h"

namespace eventgan {

GeneratedPart generate_volume(const Generator& generator, const GeneratorSpec& spec,
                              const PairKey& key, const PreparedPair& pair,
                              const VolumeLabels& labels, std::span<float> volume) {
  GeneratedPart part;
  part.threshold = pair_threshold(spec, key);
  const GeneratorInput input{pair.input, pair.content, part.threshold,
                             pair.between.at ? &pair.between : nullptr, key.draw};
  if (spec.scope.scope == Scope::kWhole) {
    part.notes = generator.generate(input, volume);
  } else {
    const TileMask wanted =
        wanted_tiles(spec.scope, pair.input, pair.content, pair.content_y, pair.content_x, labels);
    part.notes = generator.generate_tiles(input, wanted, volume);
    part.tiles = tiles_of_volume(wanted, pair.content_y, pair.content_x, pair.placement.volume);
  }
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

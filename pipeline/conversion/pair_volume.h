#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/pair_key.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/generator/generator.h"

namespace eventgan {

// What is done to every pair, whoever asks for its volume: a conversion, or a caller in Python.

/// What generate_volume tells beside the values.
struct GeneratedPart {
  GenerationNotes notes;
  /// [row, column] of the whole volume's tiles, 1 or 0: those that the scope wants. Empty: all is
  /// generated.
  std::vector<std::uint8_t> tiles;
  std::optional<ContrastThreshold> threshold;  ///< pair_threshold()
  /// Both frames are the same image, and nothing moves between them: a sensor sees nothing there.
  bool same_image = false;
};

/// Generates what the scope wants of a pair's volume, zeros elsewhere, by the sensor that the
/// manifest tells; and draws events if it gives rates and the manifest wants events (draw_events).
/// Of the same image twice all is zeros and the generator is not asked, unless it draws a motion of
/// its own (GeneratorRow::moves_one_frame, but for a still that rests) or its sensor has leak or
/// noise. `volume`: [2 bins, y, x] of pair.content, overwritten whole.
/// `labels` are in pixels of the whole volume. Throws as Generator::generate. Thread safe.
GeneratedPart generate_volume(const Generator& generator, const GeneratorSpec& spec,
                              const PairKey& key, const PreparedPair& pair,
                              const VolumeLabels& labels, std::span<float> volume);

/// Adds the noise that a manifest may ask for (stages/events/noise.h) to the volume of a pair's
/// content, [2 bins, y, x], whatever part of it was generated; over the pair's gap_s, or where that
/// is not above 0 or unknown, over spec.duration_s. Hot pixels are those of the dataset. Returns
/// whether there were any events, which is kFlagNoise. Thread safe.
bool add_pair_noise(const GeneratorSpec& spec, const PairKey& key, double gap_s,
                    const VolumeShape& content, std::span<float> volume);

/// Statistics of the generated values [2 bins, y, x] of the pair's content, with kFlagExtrapolated
/// for a gap that the generator has not seen and kFlagBeyondCalibration; then normalises the values
/// in place if asked, after which statistics.max is still that of the values as generated. Nothing
/// if a value is not finite or below zero (volume_statistics). Thread safe.
std::optional<VolumeStatistics> finish_volume(const Generator& generator,
                                              const GenerationNotes& notes, int gap_frames,
                                              Normalization normalize, const PreparedPair& pair,
                                              std::span<float> volume);

}  // namespace eventgan

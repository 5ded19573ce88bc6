#pragma once

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

#include "manifests/values/rows.h"

namespace eventgan {

/// What makes the volumes: the EventGAN network, a model to compare it with, or a camera.
enum class GeneratorKind {
  kNetwork,
  kEsim,        ///< a random affine motion of the previous frame, or a still's own motion
  kDifference,  ///< log intensity on a line from the previous frame to the next
  kEvents       ///< none: the camera's own events, of datasets that have them
};

/// What a manifest may say of a kind of generator, and what follows from the kind for a shard.
/// How it is made is in its own file (pipeline/generators/load_generator.h).
struct GeneratorRow {
  std::string_view word;  ///< the manifest's, and that of plans and reports
  GeneratorKind value;
  std::string_view title;  ///< for a person
  /// The keys of `generator` that not every kind takes; the rest are empty.
  std::array<std::string_view, 12> keys = {};
  /// It learns: weights are loaded, hashed and named in shards, and volumes are what they were
  /// trained to be. Without any, events are counted, and the description alone is hashed.
  bool has_weights = false;
  /// It makes volumes of two frames; if not, of a recording's own events.
  bool needs_frames = true;
  /// `sensor` may have the settings of a simulated one (SensorSpec).
  bool has_sensor_settings = false;
  /// It looks at what is seen between two frames, where that is known: of stills (FramesBetween).
  bool sees_between = false;
  /// It looks at the previous frame alone, under a motion that is drawn: `realism` takes the mean
  /// of several, and `simulate` makes a recording of each image.
  bool moves_one_frame = false;
  std::string_view simulation = {};  ///< what `simulate` calls it; empty: it does not have it
};

/// Every kind, in the order in which messages list them.
inline constexpr std::array kGenerators{
    GeneratorRow{
        .word = "network",
        .value = GeneratorKind::kNetwork,
        .title = "EventGAN network",
        .keys = {"weights", "engine", "device", "precision", "sample", "scope", "motion_threshold",
                 "motion_margin_px", "label_margin_px", "tile_px", "sensor", "duration_s"},
        .has_weights = true},
    GeneratorRow{.word = "esim",
                 .value = GeneratorKind::kEsim,
                 .title = "ESIM, a random motion of one frame",
                 .keys = {"sensor", "duration_s", "max_displacement_px"},
                 .has_sensor_settings = true,
                 .sees_between = true,
                 .moves_one_frame = true,
                 .simulation = "affine"},
    GeneratorRow{.word = "difference",
                 .value = GeneratorKind::kDifference,
                 .title = "log difference of two frames",
                 .keys = {"sensor", "duration_s"},
                 .has_sensor_settings = true,
                 .simulation = "difference"},
    GeneratorRow{.word = "events",
                 .value = GeneratorKind::kEvents,
                 .title = "events of a camera",
                 .needs_frames = false}};
static_assert(are_in_order(kGenerators));

/// The kind's row. Throws std::invalid_argument for a number that is no kind, which only a bad cast
/// can make.
constexpr const GeneratorRow& generator_row(GeneratorKind kind) {
  for (const GeneratorRow& row : kGenerators) {
    if (row.value == kind) return row;
  }
  throw std::invalid_argument("expected a kind of generator, got another number");
}

constexpr bool takes(const GeneratorRow& row, std::string_view key) {
  return std::ranges::find(row.keys, key) != row.keys.end();
}

constexpr bool has_weights(GeneratorKind kind) { return generator_row(kind).has_weights; }
constexpr bool needs_frames(GeneratorKind kind) { return generator_row(kind).needs_frames; }

}  // namespace eventgan

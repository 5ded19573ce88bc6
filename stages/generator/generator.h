#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "manifests/values/frames.h"
#include "manifests/values/sensor_input.h"
#include "manifests/values/tiles.h"

namespace eventgan {

/// The gaps between two frames, in frames, that a network has seen in training.
struct GapRange {
  int first = 1;
  int last = 1;  ///< itself included
  bool contains(int gap_frames) const { return first <= gap_frames && gap_frames <= last; }
  bool operator==(const GapRange&) const = default;
};

/// What a volume is made of.
struct GeneratorInput {
  /// [frame, y, x] float32, C order, previous then next, in [-1, 1].
  std::span<const float> frames;
  ImageSize size;
  /// Of the sensor: for a simulator, or a network that has thresholds(). None: the generator's own.
  std::optional<ContrastThreshold> threshold = std::nullopt;
  /// For a simulator of what is seen between the frames; null: nobody knows that.
  const FramesBetween* between = nullptr;
  /// Which of a simulator's draws for these frames; 0 is that of shards.
  std::uint64_t draw = 0;
};

/// What an engine noticed while it made a volume.
struct GenerationNotes {
  /// Of the activations stored in 8 bits the share that is at the end of the calibrated range,
  /// where all beyond it is clipped; 0..1. 0 for engines that store none.
  double saturated_share = 0;
  /// Every value of the volume is finite and >= 0: the engine looked while it stored them. If not,
  /// nobody has looked, or there is another one.
  bool sound = false;
};

/// A volume with a larger share is flagged (kFlagBeyondCalibration). manifests/guides/numerics.md
/// has the errors that come with it.
inline constexpr double kMostSaturated = 5e-4;

/// The EventGAN generator (weights.h has its network), ready to run; the seam between the pipeline
/// and the inference engines, and where tests put a fake.
///
/// Thread safety: `generate` may be called from several threads at once; the engine keeps no state
/// between calls, so a volume depends on its two frames alone, on CUDA but for its last bits.
class Generator {
 public:
  virtual ~Generator() = default;

  /// Bins per polarity of the volumes it makes.
  virtual int bins() const = 0;

  /// volume: [2 bins, y, x] float32, C order, dimensionless, ≥ 0 without upper bound; positive
  /// polarity in time order, then negative. Overwritten whole. A network computes with subnormal
  /// numbers taken for zero, whatever the calling thread does otherwise (flush_subnormals.h).
  /// Throws std::invalid_argument if the spans do not have these sizes, std::runtime_error if the
  /// engine fails. Values that are not finite are left for the caller to find.
  virtual GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const = 0;

  /// The same where `wanted`, a mask of the frames' size, says so, and zeros elsewhere. What is
  /// wanted is what `generate` gives; kernels for other shapes may add up in another order, which
  /// changes the last bits of float32 and bfloat16. Spends less than `generate` where it can, and
  /// next to nothing if no tile is wanted.
  virtual GenerationNotes generate_tiles(const GeneratorInput& pair, const TileMask& wanted,
                                         std::span<float> volume) const;

  /// Memory that one call needs beyond its spans, about; calls at the same time need it each. 0:
  /// hardly any.
  virtual std::size_t working_bytes(ImageSize) const { return 0; }

  /// Calls at the same time that keep a device beside the processor busy: their threads wait for
  /// it, and use no core. 0: a call computes on its own thread.
  virtual int device_calls(ImageSize) const { return 0; }

  /// What it was trained on; beyond it, it extrapolates. None: not known, or not trained at all (a
  /// model of a sensor).
  virtual std::optional<GapRange> training_gaps() const { return std::nullopt; }

  /// The thresholds that it can be told. A network that has them gives rates: the number of events
  /// to be expected in each voxel (draw_events makes events of them). None: it cannot be told one.
  virtual std::optional<ThresholdRange> thresholds() const { return std::nullopt; }

  /// Engine, precision and the libraries that change bytes, for the plan's fingerprint.
  virtual std::string description() const = 0;
};

/// Whether none of the values is NaN or infinite.
bool all_finite(std::span<const float> values);

/// Sets what is not wanted of a volume [channel, y, x] to zero.
void clear_unwanted(const TileMask& wanted, std::span<float> volume);

/// Throws std::invalid_argument "expected frames [2, H, W] and a volume [2 bins, H, W] of ..., got
/// ..." unless the spans are what Generator::generate takes for this size.
void check_generator_spans(const GeneratorInput& pair, std::span<const float> volume, int bins);

}  // namespace eventgan

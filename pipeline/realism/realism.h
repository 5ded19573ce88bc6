#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/generators.h"
#include "manifests/values/sensor_input.h"
#include "pipeline/realism/realism_report.h"
#include "pipeline/realism/volume_method.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {

/// What makes volumes in place of an event camera (as the EventGAN paper compares them): all of
/// kGenerators that need frames, in their order, those that draw a motion last.
std::vector<GeneratorKind> realism_methods();

/// Which pairs of a recording are compared, and with what.
struct RealismOptions {
  std::int64_t first_frame = 0;            ///< frames before are not used
  std::optional<std::int64_t> last_frame;  ///< frames after are not used; none: to the end
  std::vector<int> gaps = {1};             ///< frames between previous and next, each ≥ 1
  std::vector<GeneratorKind> methods = realism_methods();  ///< of these
  std::string weights = "shipped";  ///< of the network: a file, "shipped" or "shipped:WIDTH"

  /// Contrast thresholds of the two models, and of a network that knows its sensor, 0.01..5; none:
  /// fitted, for each, so that it makes as many events as the camera did.
  std::optional<ContrastThreshold> threshold;
  std::optional<ContrastThreshold> network_threshold;
  std::string network_weights;      ///< SHA-256 of the weights that it is of; empty: of any
  double log_epsilon = 0.02;        ///< ε of their log intensity ln(u/255 + ε), 1e-6..1
  int esim_draws = 5;               ///< motions for a pair; its scores are the means over them
  double esim_displacement_px = 5;  ///< largest displacement a frame of the motions

  std::uint64_t seed = 0;
  int threads = 0;               ///< 0: all cores
  std::filesystem::path images;  ///< folder for an image of each pair; empty: none
};

struct ComparisonRun {
  int bins = 9;
  int threads = 1;
  std::filesystem::path images;       ///< folder that exists; empty: none
  std::function<void()> on_interval;  ///< called after each interval, one call at a time
};

/// Scores each method's volumes of the intervals against the camera's, intervals in parallel; the
/// result does not depend on the number of threads. Draws FIRST-LAST.png for each interval
/// (write_comparison_png): the real volume and each method's first draw, as they are compared.
///
/// Throws InputError if the recording cannot be read, std::runtime_error if a method makes a volume
/// that is not finite or an image cannot be written. Fills `intervals`, `real` and `methods` of
/// the report, and what it knows of the recording.
RealismReport compare_volumes(const Recording& recording, std::span<const FrameInterval> intervals,
                              std::span<const std::unique_ptr<VolumeMethod>> methods,
                              const ComparisonRun& run);

/// What `eventgan realism` does: chooses the pairs, opens the network, fits the models' thresholds
/// (on at most 16 pairs, spread evenly over the chosen ones), compares. `make_progress` is called
/// with the number of pairs; empty: silent. Volumes have as many bins as the network's, 9 without.
///
/// Throws UsageError for options that cannot be, InputError if recording or weights cannot be read.
RealismReport measure_realism(
    const Recording& recording, const RealismOptions& options,
    const std::function<std::unique_ptr<Progress>(std::int64_t)>& make_progress = {});

}  // namespace eventgan

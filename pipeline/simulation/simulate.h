#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/simulation.h"
#include "pipeline/runtime/progress.h"
#include "pipeline/simulation/scene.h"

namespace eventgan {

/// One recording made.
struct RecordingSummary {
  std::string name;
  std::int64_t frames = 0;
  std::int64_t events = 0;
  std::int64_t pixels = 0;     ///< of a frame
  double duration_s = 0;       ///< from first to last frame
  double displacement_px = 0;  ///< from a frame to the next: the largest 99.5th percentile over the
                               ///< pixels; 0 where the flow is not known

  double events_per_pixel_second() const;
};

/// What a simulation did.
struct SimulationReport {
  std::string folder;
  std::vector<RecordingSummary> made;  ///< in the order of the manifest
  std::vector<std::string> kept;       ///< names of recordings that an earlier run had made
  double wall_seconds = 0;
};

/// A few lines for a person: a table of the recordings, and their sum.
std::string to_text(const SimulationReport& report);

/// One line of JSON.
std::string to_json(const SimulationReport& report);

/// Lets a sensor look at a scene to its end and writes frames, events and flows as a recording
/// (open_recording_output), which appears under its name when it is whole. `on_frame` is called
/// after each frame, `before_publishing` once the recording is on disk under another name. Throws
/// what scene, sensor, writer and these throw. Thread safe for different scenes and files.
RecordingSummary record(Scene& scene, const SensorSpec& sensor, CounterRandom random,
                        const std::filesystem::path& file, const std::string& settings,
                        const std::function<void()>& on_frame,
                        const std::function<void()>& before_publishing = {});

struct SimulationOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  int threads = 0;                              ///< 0: all cores
  bool overwrite = false;                       ///< make what is there again
  /// Called with the number of frames to do; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
};

/// The job: makes every recording of the manifest that is not there yet, sources, and the clips of
/// stills, in parallel. A recording is there when a file of its name is: files appear whole. Those
/// of stills have their labels beside them, NAME.json. All random numbers come from
/// the manifest's seed and the recording's name, so neither threads nor other sources change it.
///
/// Throws UsageError if a recording on disk was made with other settings, or has other labels; when
/// the others are made, InputError telling of each clip and still that cannot be read;
/// std::runtime_error if the disk fails; whole recordings stay.
SimulationReport simulate(const SimulationManifest& manifest, const SimulationOptions& options);

}  // namespace eventgan

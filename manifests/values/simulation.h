#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/generators.h"
#include "manifests/values/job.h"

namespace eventgan {

/// How the intensity between the given images comes about.
struct SimulationMethod {
  enum Motion {
    kClip,      ///< a real clip, frames between its frames by dense optical flow
    kStills,    ///< clips made of stills: layers move on their own
    kSimulator  ///< as a simulator has it
  };
  Motion motion = kClip;
  GeneratorKind simulator = {};  ///< with kSimulator: one of kGenerators that `simulate` has

  bool operator==(const SimulationMethod&) const = default;

  bool moves_one_frame() const {
    return motion == kSimulator && generator_row(simulator).moves_one_frame;
  }
  /// Whether each image gives a recording, not all of them one.
  bool records_each() const { return motion == kStills || moves_one_frame(); }
};

/// What a recording is written as, and the ending of its file.
enum class SimulatedFile {
  kHdf5,    ///< MVSEC's layout: events, frames, flow
  kAedat4,  ///< AEDAT 4.0: events and frames
  kRaw      ///< Prophesee's RAW, EVT 3.0: events
};

/// A clip (a video, a folder of images) and how recordings are made of it; of stills the
/// manifest of a job of `convert`, and its clips.
struct SimulationSource {
  std::string path;  ///< as written in the manifest
  std::string name;  ///< the recording's file name without its ending; default: the path's stem
  SimulationMethod method;
  std::optional<double> frames_per_second;  ///< default: the video's, 30 for images; not of stills
  std::int64_t first_frame = 0;             ///< of stills, as the next two: of these
  std::int64_t frame_count = 0;  ///< 0: to the end. With moves_one_frame the number of images
  std::int64_t frame_step = 1;   ///< takes each n-th frame, 1..100
  int frames_per_image = 7;      ///< moves_one_frame: frames of an image's motion, 2..100
  /// moves_one_frame: how far an image moves from one of its frames to the next is drawn uniformly
  /// from 0 to this, for each image; 0.1..100.
  double max_displacement_px = 5;
};

/// A job of `eventgan simulate`, as manifests/schemas/simulation.schema.json describes it.
struct SimulationManifest : ManifestOrigin {
  std::string name;
  std::uint64_t seed = 0;
  std::vector<SimulationSource> sources;
  std::optional<ImageSize> size;  ///< of the sensor, sides 16..8192; frames are scaled to cover it,
                                  ///< cut around the centre. None: the frames' own size
  SensorSpec sensor;
  std::string output_directory;
  SimulatedFile file = SimulatedFile::kHdf5;
};

std::string_view to_string(SimulationMethod method);
std::string_view to_string(SimulatedFile file);

}  // namespace eventgan

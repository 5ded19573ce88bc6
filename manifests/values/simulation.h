#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"

namespace eventgan {

/// How the intensity between the given images comes about.
enum class SimulationMethod {
  kAffine,      ///< ESIM as the EventGAN paper uses it: a random affine motion of each image
  kClip,        ///< a real clip, frames between its frames by dense optical flow
  kDifference,  ///< log intensity moves on a line from each frame to the next
  kStills       ///< clips made of stills: layers move on their own
};

/// What a recording is written as, and the ending of its file.
enum class SimulatedFile {
  kHdf5,    ///< MVSEC's layout: events, frames, flow
  kAedat4,  ///< AEDAT 4.0: events and frames
  kRaw      ///< Prophesee's RAW, EVT 3.0: events
};

/// A clip (a video, a folder of images) and how recordings are made of it; with kStills the
/// manifest of a job of `convert`, and its clips.
struct SimulationSource {
  std::string path;  ///< as written in the manifest
  std::string name;  ///< the recording's file name without its ending; default: the path's stem
  SimulationMethod method = SimulationMethod::kClip;
  std::optional<double> frames_per_second;  ///< default: the video's, 30 for images; not of kStills
  std::int64_t first_frame = 0;             ///< of kStills, as the next two: of the stills
  std::int64_t frame_count = 0;  ///< 0: to the end. With kAffine the number of images used
  std::int64_t frame_step = 1;   ///< takes each n-th frame, 1..100
  int frames_per_image = 7;      ///< kAffine: frames of the motion of one image, 2..100
  /// kAffine: how far an image moves from one of its frames to the next is drawn uniformly from 0
  /// to this, for each image; 0.1..100.
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

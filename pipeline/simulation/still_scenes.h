#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/simulation.h"
#include "pipeline/simulation/scene.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"

namespace eventgan {

/// The clips of stills (PairSpec::clip_frames) that `convert` makes of a manifest, as scenes: its
/// sources in their order, their stills by name. Of these a source of a simulation takes every
/// `frame_step`-th from `first_frame` on. Thread safe.
class StillScenes {
 public:
  /// source.path is the manifest of the job of `convert`. Opens its sources of clips; throws what
  /// reading it and opening them throws, and InputError if it has none or too few stills.
  StillScenes(const SimulationSource& source, const SimulationManifest& manifest);

  std::int64_t count() const { return static_cast<std::int64_t>(clips_.size()); }

  /// The still's sample_id in its dataset.
  const std::string& still(std::int64_t position) const { return clip(position).still; }

  /// The clip's frames but its first one, which is the still itself: it alone is not smoothed by
  /// interpolation, and that would look like events.
  std::int64_t frame_count(std::int64_t position) const {
    return static_cast<std::int64_t>(clip(position).frames.size());
  }

  /// What the scene and its labels are made of, hashed: the image's name and size, its annotation
  /// with the names of classes and joints, the manifest's settings of clips.
  /// Throws InputError if the annotation or the frame has a fault.
  std::string hash(std::int64_t position) const;

  /// Of the clip's frames, before they are scaled to the sensor; empty if it cannot be read.
  ImageSize frame_size(std::int64_t position) const;

  /// What moves between two frames is the layers, not their pixels. Throws InputError if the image
  /// or its annotation cannot be read.
  std::unique_ptr<Scene> scene(std::int64_t position) const;

  /// The labels of its frames but the first labelled one, whose pair has the still, in pixels of
  /// the sensor as JSON, as `convert` reads them beside a recording
  /// (manifests/guides/real_events.md). Throws as above.
  std::string labels(std::int64_t position) const;

 private:
  struct Clip {
    std::size_t source;
    std::string still;
    std::vector<const LabelledFrame*> frames;  ///< in order of time
    double start_s;  ///< of the recording: the time of its first frame within the clip
  };

  const Clip& clip(std::int64_t position) const {
    return clips_.at(static_cast<std::size_t>(position));
  }

  std::optional<ImageSize> size_;
  JobManifest job_;
  std::vector<std::unique_ptr<Dataset>> datasets_;  ///< null: not of clips
  std::vector<Clip> clips_;
  FrameDecoder decoder_;
};

}  // namespace eventgan

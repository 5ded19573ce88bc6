#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "manifests/values/events.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "pipeline/conversion/pair_volume.h"
#include "pipeline/generators/load_generator.h"
#include "pipeline/library/array_images.h"

namespace eventgan {

/// What a caller knows of the image's labels.
struct KnownLabels {
  Annotation annotation;
  bool has_boxes = false;
  bool has_joints = false;
};

/// A pair's volume but for its values.
struct MadeVolume {
  GeneratedPart part;
  VolumeStatistics statistics;  ///< only with labels, or of a volume that is normalised
  Placement placement;
  VolumeLabels labels;
};

/// Makes volumes of images in memory as the program makes them of files with the same manifest.
/// Thread safe.
class PairEngine {
 public:
  /// `manifest`: see parse_pair_manifest. Throws UsageError or InputError.
  explicit PairEngine(const std::string& manifest);

  const JobManifest& job() const { return job_; }
  const LoadedGenerator& loaded() const { return loaded_; }
  const Generator& generator() const { return *loaded_.generator; }

  Placement placement(ImageSize source) const { return place(source, job_.image); }

  /// Shape of the volumes of such images. Throws std::bad_alloc if `count` of them, and what
  /// `threads` threads need to make them, are beyond the memory: asking for it could end the
  /// process.
  VolumeShape shape(ImageSize source, std::size_t count, int threads) const;

  /// Whether thresholds, noise, events or a simulator's motion are drawn for each pair.
  bool draws() const;

  /// Makes the volume [2 bins, H, W] of pair `index`. `labels` may be null, unless the manifest's
  /// scope is theirs. `gap`: between the images in frames. `draw`: which of the draws for them; 0
  /// is that of shards. Throws UsageError, std::bad_alloc, and std::runtime_error for a volume that
  /// is not sound.
  MadeVolume make(const ImagePairs& pairs, std::size_t index, const KnownLabels* labels, int gap,
                  std::uint64_t draw, std::span<float> volume) const;

 private:
  void require_labels(const KnownLabels* labels) const;

  JobManifest job_;
  LoadedGenerator loaded_;
  std::size_t memory_bytes_;
};

}  // namespace eventgan

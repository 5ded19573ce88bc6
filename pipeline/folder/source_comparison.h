#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/shard.h"
#include "stages/frames/dataset.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {

/// Compares shards with the sources they were made from, as these are today. Thread safety: one
/// thread at a time.
class SourceComparison {
 public:
  /// Opens the sources of `manifest`, which is the frozen one. A source that is not there is left
  /// out, with a note.
  explicit SourceComparison(JobManifest manifest);

  /// Gives the samples of the frozen plan the keys that their labels have today (see make_plan.h).
  void renew_samples(Plan& plan) const;

  /// Why labels of some sources are not compared; a line each.
  const std::vector<std::string>& notes() const { return notes_; }

  /// Compares every valid sample: that it is the planned one, that its labels are those of its
  /// annotation read anew and mapped by the placement of its source size, that its picture, where
  /// it can be read, has that size. Of a quarantined sample the original annotation is compared, if
  /// the shard has one and it can be read. Texts "expected X, got Y (sample SLOT, ID)" without the
  /// file's name; none for a source that is not there.
  std::vector<std::string> faults(const PlannedShard& planned, const ShardReader& reader);

  /// Valid samples that were compared.
  long long compared() const { return compared_; }

 private:
  std::vector<std::string> sample_faults(const Dataset& dataset, const PlannedSample& planned,
                                         const ShardSample& stored, ImageSize volume_size);
  std::optional<ImageSize> picture_size(const std::string& path);

  JobManifest manifest_;
  std::vector<std::unique_ptr<Dataset>> datasets_;  // null where the source is not there
  std::vector<std::string> notes_;
  std::map<std::string, std::optional<ImageSize>> sizes_;  // by path; a video serves many samples
  long long compared_ = 0;
};

/// What a shard's sample holds that its source does not: the annotation's bytes, its boxes and
/// persons exactly; their places in the volume, `mapped`, to a millionth of a pixel, since the last
/// bits may depend on the compiler. Texts "expected X, got Y" in which `place` names the
/// annotation; where the bytes differ, that alone. Empty if all is the same.
std::vector<std::string> label_differences(const ShardSample& stored, const Annotation& source,
                                           const VolumeLabels& mapped, const std::string& place);

}  // namespace eventgan

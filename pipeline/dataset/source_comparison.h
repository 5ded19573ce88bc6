#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/shard.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// Compares shards with the sources they were made from, as these are today. Thread safety: one
/// thread at a time.
class SourceComparison {
 public:
  /// Opens the sources of `manifest`, which is the frozen one. A source that is not there is left
  /// out, with a note. `stored`: as number_classes takes it.
  explicit SourceComparison(JobManifest manifest,
                            const std::vector<std::optional<ClassNames>>& stored = {});

  /// Gives the samples of the frozen plan the keys that their labels have today (see make_plan.h).
  void renew_samples(Plan& plan) const;

  /// Why labels of some sources are not compared; a line each.
  const std::vector<std::string>& notes() const { return notes_; }

  /// Compares every valid sample: that it is the planned one, that its columns of `/pairs` and
  /// `/labels` are those of the plan and of its annotation read again and mapped by the placement
  /// of its source size, that its image, where it can be read, has that size and its optical flow,
  /// that classes and joints have the source's names. Of a quarantined sample the original
  /// annotation is compared, if the shard has one and it can be read. Texts "expected X, got Y
  /// (sample SLOT, ID)" without the file's name; none for a source that is not there.
  std::vector<std::string> faults(const PlannedShard& planned, const ShardReader& reader);

  /// Valid samples that were compared.
  long long compared() const { return compared_; }

 private:
  std::vector<std::string> sample_faults(const PlannedShard& shard, int slot,
                                         const ShardSample& stored, const ShardReader& reader);

  JobManifest manifest_;
  std::vector<std::unique_ptr<Dataset>> datasets_;  // null where the source is not there
  std::vector<std::string> notes_;
  ImageSizes sizes_;   ///< of the datasets that keep none; a video serves many samples
  PairReader reader_;  ///< of stills whose flow is compared
  long long compared_ = 0;
};

/// Where the stored numbers of classes and joints mean something else by today's source, which may
/// have gained classes: texts "expected the LIST of the source, X, got Y".
std::vector<std::string> schema_faults(const LabelSchema& stored, const LabelSchema& source);

/// What slot `slot` of `stored` holds that `expected`, the sample made again from its source (its
/// `tiles` as stored), would not: every column of the format but those of `/events`, which the
/// generator makes, is compared, so that a new one cannot be forgotten. Numbers of 64 bits may
/// differ by 1e-9, those of outlines by the last of their 32 bits and those of flow by the last of
/// 16, since the compiler decides on last bits; all else is the same exactly.
/// A column that shards of today may have and this one has not is left out. Texts "expected X in
/// COLUMN by PLACE, got Y" in which `place` names the annotation, one for each box,
/// person or sample and column; where the annotation's bytes or the numbers of labels differ, that
/// alone. Empty if all is the same. Throws std::logic_error as append_row does.
std::vector<std::string> row_differences(const ShardHeader& header, const ShardTables& stored,
                                         int slot, const ShardSample& expected,
                                         const std::string& place);

}  // namespace eventgan

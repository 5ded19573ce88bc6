#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/plan.h"

namespace eventgan {

/// Lays samples into shards of at most `samples_per_shard`, as they come: a sample is never copied,
/// since a job has millions. A shard holds one source and one size, samples keep their order, sizes
/// come in the order of their first sample. Shards are numbered within their split, over all
/// sources.
///
/// A sample of unknown size will be quarantined; once its picture is mended it may have any size,
/// and the number of shards cannot change then. So it gets a shard of its own, after the others of
/// its source, marked size_unknown; only samples that follow each other in one file (a video) share
/// one. Its size is a guess until then: the one that most samples of the source have (the first of
/// several; where none is known: 1x1).
class ShardLayout {
 public:
  ShardLayout(std::string name, int samples_per_shard);

  /// Samples are of this source until the next one begins.
  void begin_source(int source, const std::string& split);

  /// `volume_size` is {0, 0} if the picture could not be read.
  void add(PlannedSample sample, ImageSize volume_size);

  /// The layout is empty afterwards.
  std::vector<PlannedShard> finish();

 private:
  /// The source's samples of one size.
  struct Group {
    ImageSize size;
    std::vector<PlannedShard> shards;
    std::size_t samples = 0;
  };

  Group& group(ImageSize size);
  void append(Group& group, PlannedSample sample);
  void append_unknown(PlannedSample sample);
  ImageSize most_common_size() const;
  void end_source();

  std::string name_;
  std::size_t samples_per_shard_;
  int source_ = 0;
  std::string split_;
  std::vector<Group> groups_;                               // in the order of their first sample
  std::map<std::pair<int, int>, std::size_t> group_index_;  // by height and width
  std::vector<PlannedShard> unknown_;                       // their volume_size is not set yet
  std::vector<PlannedShard> shards_;                        // of the sources that have ended
  std::vector<std::string> splits_;                         // of each of these
};

}  // namespace eventgan

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
/// come in the order of their first sample. A sample of unknown size joins the size most samples of
/// its source have (the first of several; where none is known: 1x1), since it will be quarantined
/// anyway. Shards are numbered within their split, over all sources.
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
    std::vector<std::size_t> places;  // of each sample among all of the source's
  };

  Group& group(ImageSize size);
  void append(Group& group, std::size_t place, PlannedSample sample);
  void place_unknown();
  void end_source();

  std::string name_;
  std::size_t samples_per_shard_;
  int source_ = 0;
  std::string split_;
  std::size_t next_place_ = 0;
  std::vector<Group> groups_;                               // in the order of their first sample
  std::map<std::pair<int, int>, std::size_t> group_index_;  // by height and width
  Group unknown_;
  std::vector<PlannedShard> shards_;  // of the sources that have ended
  std::vector<std::string> splits_;   // of each of these
};

}  // namespace eventgan

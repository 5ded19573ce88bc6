#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "pipeline/training/records/csv_table.h"
#include "pipeline/training/samples/crop_reader.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Means over the validation pairs.
struct ValidationScores {
  double volume_loss = 0;  ///< mean |generated - real| of what the network gives
  RealismScores realism;
};

/// Fixed pairs to judge a generator by in the course of a training: consecutive frames of the
/// validation recordings, the middle of the picture, at most 16, evenly spread where there are
/// more. Read once and kept.
class ValidationPairs {
 public:
  /// `crop`: the training's; recordings with smaller pictures are taken whole. Throws InputError if
  /// a recording cannot be read.
  ValidationPairs(const CropReader& reader, ImageSize crop);

  const std::vector<TrainingSample>& samples() const { return samples_; }

  ValidationScores judge(const Generator& generator) const;

 private:
  std::vector<TrainingSample> samples_;
};

/// What the generator makes of a sample: [2 bins, y, x].
std::vector<float> generated_volume(const Generator& generator, const TrainingSample& sample);

/// validation.csv: a row a checkpoint; columns step, volume_loss and realism's scores.
class ValidationLog {
 public:
  /// Goes on with FILE; rows of checkpoints after `step` are cut off.
  ValidationLog(const std::filesystem::path& file, std::int64_t step);

  void add(std::int64_t step, const ValidationScores& scores);

 private:
  CsvTable table_;
};

}  // namespace eventgan

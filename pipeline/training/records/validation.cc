#include "pipeline/training/records/validation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace eventgan {
namespace {

constexpr std::size_t kMostPairs = 16;

/// A frame of a [frame, y, x] float picture in [-1, 1], as it was recorded.
GreyImage grey_frame(const TrainingSample& sample, std::size_t frame) {
  const std::size_t plane = sample.shape.size.pixel_count();
  GreyImage image{sample.shape.size, {}};
  for (std::size_t i = 0; i < plane; ++i) {
    const float value = (sample.frames[frame * plane + i] + 1) * 127.5f;
    image.pixels.push_back(static_cast<std::uint8_t>(std::lround(value)));
  }
  return image;
}

double mean_difference(const std::vector<float>& first, const std::vector<float>& second) {
  const double sum =
      std::transform_reduce(first.begin(), first.end(), second.begin(), 0.0, std::plus<>(),
                            [](double a, double b) { return std::abs(a - b); });
  return sum / static_cast<double>(std::max<std::size_t>(first.size(), 1));
}

CsvTable::Row validation_columns() {
  return {"step",
          "volume_loss",
          "f1_raw",
          "f1_time",
          "f1_time_polarity",
          "pool_mse_2",
          "pool_mse_4",
          "time_correlation",
          "polarity_correlation",
          "events_per_pixel",
          "positive_share"};
}

}  // namespace

std::vector<float> generated_volume(const Generator& generator, const TrainingSample& sample) {
  std::vector<float> volume(sample.shape.value_count());
  generator.generate(sample.network_frames, sample.shape.size, volume);
  return volume;
}

ValidationPairs::ValidationPairs(const CropReader& reader, ImageSize crop) {
  std::vector<std::pair<std::size_t, std::int64_t>> pairs;  // recording, first frame
  for (std::size_t i = 0; i < reader.recordings().size(); ++i) {
    const TrainingRecording& recording = reader.recordings()[i];
    for (std::int64_t frame = recording.first_frame; frame < recording.last_frame; ++frame) {
      pairs.emplace_back(i, frame);
    }
  }
  const std::size_t count = std::min(pairs.size(), kMostPairs);
  for (std::size_t k = 0; k < count; ++k) {
    const auto [recording, frame] = pairs[k * pairs.size() / count];
    const ImageSize size = reader.recordings()[recording].recording->size();
    samples_.push_back(reader.read(recording, frame, frame + 1, centre_crop(size, crop)));
  }
}

ValidationScores ValidationPairs::judge(const Generator& generator) const {
  ValidationScores result;
  std::vector<RealismScores> scores;
  for (const TrainingSample& sample : samples_) {
    const std::vector<float> volume = generated_volume(generator, sample);
    result.volume_loss +=
        mean_difference(volume, sample.volume) / static_cast<double>(samples_.size());
    scores.push_back(realism_scores(volume, sample.volume, sample.shape, grey_frame(sample, 0),
                                    grey_frame(sample, 1)));
  }
  result.realism = mean_scores(scores);
  return result;
}

ValidationLog::ValidationLog(const std::filesystem::path& file, std::int64_t step)
    : table_(file, validation_columns(), [&](const CsvTable::Row& row) {
        return csv_value(row.front()) <= static_cast<double>(step);
      }) {}

void ValidationLog::add(std::int64_t step, const ValidationScores& scores) {
  CsvTable::Row row{std::to_string(step)};
  const RealismScores& realism = scores.realism;
  for (const double value :
       {scores.volume_loss, realism.f1_raw, realism.f1_time, realism.f1_time_polarity,
        realism.pool_mse_2, realism.pool_mse_4, realism.time_correlation,
        realism.polarity_correlation, realism.events_per_pixel, realism.positive_share}) {
    row.push_back(csv_number(value));
  }
  table_.add(row);
  table_.flush();
}

}  // namespace eventgan

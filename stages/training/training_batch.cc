#include "stages/training/detail/training_batch.h"

#include <ATen/Functions.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "manifests/values/sensor_input.h"

namespace eventgan {
namespace {

/// `values_of`: of a sample, [channels, y, x].
template <class Values>
at::Tensor stack(std::span<const TrainingSample> samples, const Values& values_of, int channels,
                 ImageSize size, c10::Device device) {
  at::Tensor tensor =
      at::empty({std::int64_t(samples.size()), channels, size.height, size.width}, at::kFloat);
  float* out = tensor.data_ptr<float>();
  const std::size_t count = std::size_t(channels) * size.pixel_count();
  for (const TrainingSample& sample : samples) {
    const auto& values = values_of(sample);
    if (values.size() != count) {
      throw std::invalid_argument("expected " + std::to_string(count) + " numbers, got " +
                                  std::to_string(values.size()) + ", in " + sample.origin);
    }
    out = std::copy(values.begin(), values.end(), out);
  }
  return tensor.to(device).contiguous(at::MemoryFormat::ChannelsLast);
}

at::Tensor stack_inputs(std::span<const TrainingSample> samples, ImageSize size,
                        c10::Device device) {
  if (!samples.front().threshold) {
    return stack(samples, std::mem_fn(&TrainingSample::network_frames), 2, size, device);
  }
  const auto input = [](const TrainingSample& sample) {
    return sensor_input(sample.network_frames, sample.threshold.value());
  };
  return stack(samples, input, 3, size, device);
}

}  // namespace

TrainingBatch make_training_batch(std::span<const TrainingSample> samples, int bins,
                                  c10::Device device) {
  if (samples.empty()) throw std::invalid_argument("expected samples, got none");
  const VolumeShape shape{bins, samples[0].shape.size};
  for (const TrainingSample& sample : samples) {
    if (sample.shape == shape && sample.threshold.has_value() == samples[0].threshold.has_value() &&
        sample.taught_rates.empty() == samples[0].taught_rates.empty()) {
      continue;
    }
    throw std::invalid_argument(
        "expected samples of one size and " + std::to_string(bins) +
        " bins, all with a threshold or none, all with a teacher's rates or none, got "
        "another, in " +
        sample.origin);
  }
  const auto values = [&](auto member, int channels) {
    return stack(samples, std::mem_fn(member), channels, shape.size, device);
  };
  const at::Tensor volume = values(&TrainingSample::volume, shape.channels());
  return {values(&TrainingSample::frames, 2), values(&TrainingSample::network_frames, 2), volume,
          samples[0].taught_rates.empty() ? volume
                                          : values(&TrainingSample::taught_rates, shape.channels()),
          stack_inputs(samples, shape.size, device)};
}

}  // namespace eventgan

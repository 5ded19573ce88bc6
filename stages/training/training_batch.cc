#include "stages/training/detail/training_batch.h"

#include <ATen/Functions.h>

#include <algorithm>
#include <stdexcept>

namespace eventgan {
namespace {

at::Tensor stack(std::span<const TrainingSample> samples,
                 std::vector<float> TrainingSample::*values, int channels, ImageSize size,
                 c10::Device device) {
  at::Tensor tensor =
      at::empty({std::int64_t(samples.size()), channels, size.height, size.width}, at::kFloat);
  float* out = tensor.data_ptr<float>();
  const std::size_t count = std::size_t(channels) * size.pixel_count();
  for (const TrainingSample& sample : samples) {
    if ((sample.*values).size() != count) {
      throw std::invalid_argument("expected " + std::to_string(count) + " numbers, got " +
                                  std::to_string((sample.*values).size()) + ", in " +
                                  sample.origin);
    }
    out = std::copy((sample.*values).begin(), (sample.*values).end(), out);
  }
  return tensor.to(device).contiguous(at::MemoryFormat::ChannelsLast);
}

}  // namespace

TrainingBatch make_training_batch(std::span<const TrainingSample> samples, int bins,
                                  c10::Device device) {
  if (samples.empty()) throw std::invalid_argument("expected samples, got none");
  const VolumeShape shape{bins, samples[0].shape.size};
  for (const TrainingSample& sample : samples) {
    if (sample.shape == shape) continue;
    throw std::invalid_argument("expected samples of one size and " + std::to_string(bins) +
                                " bins, got another, in " + sample.origin);
  }
  return {stack(samples, &TrainingSample::frames, 2, shape.size, device),
          stack(samples, &TrainingSample::network_frames, 2, shape.size, device),
          stack(samples, &TrainingSample::volume, shape.channels(), shape.size, device)};
}

at::Tensor network_frames_tensor(const TrainingSample& sample, c10::Device device) {
  return stack({&sample, 1}, &TrainingSample::network_frames, 2, sample.shape.size, device);
}

}  // namespace eventgan

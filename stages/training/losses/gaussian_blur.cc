#include <ATen/TensorOperators.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/training/losses/gaussian_blur_internal.h"

// Shifted sums along each axis: with one channel in and out, LibTorch's convolution is ten times
// slower on a CPU. The blur is its own transpose, so it is its own backward pass too.

namespace eventgan {
namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5;

/// Weights of the distances 0..5, those of both sides summing to 1.
std::array<double, kRadius + 1> window() {
  std::array<double, kRadius + 1> weights;
  double sum = 0;
  for (int distance = 0; distance <= kRadius; ++distance) {
    weights[distance] = std::exp(-distance * distance / (2 * kSigma * kSigma));
    sum += (distance == 0 ? 1 : 2) * weights[distance];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

at::Tensor blur_along(const at::Tensor& pictures, std::int64_t axis) {
  const auto weights = window();
  const std::int64_t length = pictures.size(axis);
  at::Tensor result = pictures * weights[0];
  for (std::int64_t distance = 1; distance <= std::min<std::int64_t>(kRadius, length - 1);
       ++distance) {
    const std::int64_t count = length - distance;
    const double weight = weights[distance];
    result.narrow(axis, 0, count).add_(pictures.narrow(axis, distance, count), weight);
    result.narrow(axis, distance, count).add_(pictures.narrow(axis, 0, count), weight);
  }
  return result;
}

class GaussianBlur : public torch::autograd::Function<GaussianBlur> {
 public:
  static at::Tensor forward(torch::autograd::AutogradContext*, const at::Tensor& pictures) {
    return blur_along(blur_along(pictures, 2), 3);
  }

  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context,
                                               torch::autograd::tensor_list gradients) {
    return {forward(context, gradients[0])};
  }
};

}  // namespace

at::Tensor gaussian_blur(const at::Tensor& pictures) { return GaussianBlur::apply(pictures); }

}  // namespace eventgan

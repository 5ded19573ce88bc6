#include "stages/training/losses/hinge_loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/relu.h>

namespace eventgan {

at::Tensor discriminator_hinge_loss(const at::Tensor& real_logits, const at::Tensor& fake_logits) {
  return at::relu(1 - real_logits).mean() + at::relu(1 + fake_logits).mean();
}

at::Tensor generator_hinge_loss(const at::Tensor& logits) { return -logits.mean(); }

}  // namespace eventgan

#include <ATen/autocast_mode.h>

#include "stages/training/autocast_scope_internal.h"

namespace eventgan {

AutocastScope::AutocastScope(c10::Device device, bool enabled)
    : cuda_(device.is_cuda()), enabled_(enabled) {
  if (!enabled_) return;
  enabled_before_ = cuda_ ? at::autocast::is_enabled() : at::autocast::is_cpu_enabled();
  if (cuda_) {
    at::autocast::set_autocast_gpu_dtype(at::kBFloat16);
  } else {
    at::autocast::set_autocast_cpu_dtype(at::kBFloat16);
  }
  at::autocast::increment_nesting();
  switch_to(true);
}

AutocastScope::~AutocastScope() {
  if (!enabled_) return;
  // The cache holds casts of parameters, which the next optimiser step makes stale.
  if (at::autocast::decrement_nesting() == 0) at::autocast::clear_cache();
  switch_to(enabled_before_);
}

void AutocastScope::switch_to(bool on) const {
  if (cuda_) {
    at::autocast::set_enabled(on);
  } else {
    at::autocast::set_cpu_enabled(on);
  }
}

}  // namespace eventgan

#pragma once

#include <c10/core/Device.h>

namespace eventgan {

/// While it lives, this thread's convolutions on the device run in bfloat16 (LibTorch's autocast),
/// if `enabled`. Parameters stay float32; their casts are forgotten at the end. For forward passes
/// alone: losses and backward passes stay outside.
class AutocastScope {
 public:
  AutocastScope(c10::Device device, bool enabled);
  ~AutocastScope();
  AutocastScope(const AutocastScope&) = delete;
  AutocastScope& operator=(const AutocastScope&) = delete;

 private:
  void switch_to(bool on) const;

  bool cuda_;
  bool enabled_;
  bool enabled_before_ = false;
};

}  // namespace eventgan

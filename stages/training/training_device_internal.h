#pragma once

#include <c10/core/Device.h>

#include <string>

namespace eventgan {

/// "cpu", or "cuda" where LibTorch was built with CUDA and finds a device; throws UsageError else.
c10::Device training_device(const std::string& name);

}  // namespace eventgan

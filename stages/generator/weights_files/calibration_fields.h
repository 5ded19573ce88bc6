#pragma once

#include <map>
#include <memory>
#include <string>

#include "stages/generator/calibration/calibration.h"
#include "stages/generator/weights_files/safetensors.h"

namespace eventgan {

// How a weights file holds a calibration: metadata calibration.pairs and calibration.origin, and
// for each tensor calibration.TENSOR.highest and .mean [channel], behind a LeakyReLU also .offset
// [channel] and .mixing [channel, channel].

/// Adds views of the calibration, which must outlive them.
void add_calibration(const Calibration& calibration, std::map<std::string, TensorView>& tensors,
                     std::map<std::string, std::string>& metadata);

/// Takes the calibration out of the content; null if there is none. Throws std::runtime_error
/// "expected X, got Y" if it is not whole, or as check_calibration.
std::shared_ptr<const Calibration> take_calibration(SafetensorsFile& content, int base_channels,
                                                    const std::string& name);

}  // namespace eventgan

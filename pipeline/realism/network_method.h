#pragma once

#include <memory>
#include <string>

#include "pipeline/realism/volume_method.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// The generator as "network": the frames go in as they are, at their own size, in [-1, 1].
/// `weights` is told in the report.
std::unique_ptr<VolumeMethod> make_network_method(std::unique_ptr<Generator> generator,
                                                  const std::string& weights);

/// The generator of a safetensors file, of "shipped" or of "shipped:WIDTH". Throws InputError if
/// the weights cannot be read or are not shipped, UsageError for another WIDTH than 1..64 and for
/// "untrained:WIDTH".
std::unique_ptr<Generator> open_realism_generator(const std::string& weights);

}  // namespace eventgan

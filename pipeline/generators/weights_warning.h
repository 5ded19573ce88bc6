#pragma once

#include <string>

#include "manifests/values/job.h"

namespace eventgan {

/// What the user must know of the weights that a manifest asks for, by their name alone, in a short
/// line: that they are untrained, or those that come with the program. Empty for others, and for
/// simulators.
std::string weights_warning(const JobManifest& manifest);

/// The same of untrained weights, whatever their name.
std::string untrained_warning(const std::string& name);

}  // namespace eventgan

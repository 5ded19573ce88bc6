#pragma once

#include <filesystem>
#include <span>

#include "stages/generator/generator.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// Draws what the generator makes of four of the samples, evenly spread (of all, if there are
/// fewer), beside the real volumes: see write_comparison_png, which says what is thrown.
void write_generator_picture(const Generator& generator, std::span<const TrainingSample> samples,
                             const std::filesystem::path& file);

}  // namespace eventgan

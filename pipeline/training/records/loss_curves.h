#pragma once

#include <filesystem>
#include <span>

#include "pipeline/training/records/loss_log.h"

namespace eventgan {

/// Draws the losses over the steps, a panel for each that has values, and writes a PNG: phases one
/// after another on the horizontal axis, the raw values faint and their running mean (over a 50th
/// of the values) in front. The vertical axis is logarithmic where all values are above 0 and span
/// more than two decades. No rows give a blank picture. Throws std::runtime_error naming the file.
void write_loss_curves(std::span<const LossRow> rows, const std::filesystem::path& file);

}  // namespace eventgan

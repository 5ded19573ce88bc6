#pragma once

#include <span>

namespace eventgan {

/// How far `volume` is from `reference`, both of one size: ‖volume - reference‖ / ‖reference‖ in
/// the Euclidean norm, summed in double. Of a reference of zeros: 0 if the volume is zeros too,
/// else infinity. Pure.
double relative_distance(std::span<const float> volume, std::span<const float> reference);

}  // namespace eventgan

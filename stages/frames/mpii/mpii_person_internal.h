#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "manifests/labels.h"

namespace eventgan {

/// True if anybody in `entry` (an element of annolist as mat_to_json gives it) has a joint or a
/// centre.
bool has_mpii_persons(const nlohmann::ordered_json& entry);

/// The persons of `entry`, one for each element of its annorect, in that order.
///
/// MPII counts pixels from 1: one is taken from every joint, centre and head box corner here, once,
/// and nowhere else. A head box's corners, so shifted, are taken for its edges. What is absent or
/// empty stays absent: joints kMissingPoint with visible 0, centre kMissingPoint, scale -1, no head
/// box. A joint at (0, 0), which is no pixel where they count from 1, is
/// how some fill in what is not annotated: absent. is_visible may be a number, a character, a
/// logical (0 or 1), or empty or absent: -1. Throws std::invalid_argument("expected .., got .. at
/// annorect[1].annopoints.point[3].x") for a joint id outside 0..15 or given twice, a number that
/// is not finite, a field of another type, half a point or half a head box.
std::vector<Person> parse_mpii_persons(const nlohmann::ordered_json& entry);

}  // namespace eventgan

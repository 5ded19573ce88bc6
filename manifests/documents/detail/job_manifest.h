#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/detail/strict_json.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Reads one of the manifest's sources.
SourceSpec read_source(const StrictValue& value);

/// Reads a source's `pairs`.
PairSpec read_pairs(const StrictValue& value);

/// Reads gaps, 1..6, each once, even with kAround; ascending, whatever order they are written in.
std::vector<int> read_gaps(const StrictValue& value, PairSide side);

/// Reads the manifest's `image`. The preset, named or else that of the sources' datasets, fills in
/// `grey` and `blur`, unless these are given.
ImageSpec read_image(const StrictValue& value, const std::vector<SourceSpec>& sources);

/// Reads "left" or "right".
std::string read_stereo_camera(const StrictValue& value);

/// Reads width and height, each in least..most.
ImageSize read_size(const StrictValue& value, int least, int most);

/// Reads [least, most], both in lowest..highest.
std::array<double, 2> read_ends(const StrictValue& value, double lowest, double highest);

/// Reads a recording's `columns`.
EventFields read_columns(const StrictValue& value);

}  // namespace eventgan

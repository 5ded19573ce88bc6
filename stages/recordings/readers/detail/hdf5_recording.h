#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "stages/recordings/readers/hdf5_layouts.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// A recording in an HDF5 file, of which events are read by ranges. `sensor` is what the options
/// give: a file without frames tells no size, and frames of another size are left out. Throws
/// InputError.
std::unique_ptr<Recording> open_hdf5_recording(
    const std::filesystem::path& path, const Hdf5Layout& layout,
    const std::optional<ImageSize>& sensor = std::nullopt);

}  // namespace eventgan

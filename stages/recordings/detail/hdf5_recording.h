#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "stages/recordings/recording.h"

namespace eventgan {

/// Where a recording's datasets lie in an HDF5 file.
struct Hdf5Layout {
  std::string events;       ///< [events, 4] float: x, y, t in seconds, p
  std::string frames;       ///< [frames, height, width] uint8
  std::string frame_times;  ///< [frames] float, seconds
  std::string
      event_index;   ///< [frames] integers near the last event before the frame; may be absent
  std::string flow;  ///< [frames - 1, 2, height, width] float; may be absent
};

/// MVSEC's, of one camera: "left" or "right".
Hdf5Layout mvsec_layout(const std::string& camera);

/// The EventGAN authors', which has no flow.
Hdf5Layout eventgan_layout();

/// A recording in an HDF5 file, of which events are read by ranges. Throws InputError.
std::unique_ptr<Recording> open_hdf5_recording(const std::filesystem::path& path,
                                               const Hdf5Layout& layout);

}  // namespace eventgan

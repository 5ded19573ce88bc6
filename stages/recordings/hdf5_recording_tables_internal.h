#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "manifests/image_size.h"
#include "stages/recordings/hdf5_layout_internal.h"
#include "stages/recordings/hdf5_table_internal.h"

namespace eventgan {

/// The datasets of a recording, of which it is known that they fit together.
struct Hdf5RecordingTables {
  Hdf5Handle file;  ///< first, so that it closes last
  Hdf5Table events;
  Hdf5Table frames;
  std::optional<Hdf5Table> flow;
  ImageSize size;
  std::vector<double> frame_times_s;
  std::vector<std::int64_t> event_index;  ///< as the file says, or empty
};

/// Opens a file. Throws InputError, the cause nested. Call it within an Hdf5Turn.
Hdf5RecordingTables open_hdf5_recording_tables(const std::filesystem::path& path,
                                               const Hdf5Layout& layout);

}  // namespace eventgan

#include <system_error>
#include <utility>

#include "manifests/faults.h"
#include "stages/frames/decoding/picture_limits.h"
#include "stages/recordings/frame_times_internal.h"
#include "stages/recordings/hdf5_recording_tables_internal.h"

namespace eventgan {
namespace {

Hdf5Handle open_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw InputError("expected an HDF5 file, got " +
                     std::string(std::filesystem::exists(path, ignored) ? "a folder" : "none") +
                     ", in " + path.string());
  }
  try {
    const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "create", "access properties");
    // Nobody writes to a recording, and many cluster file systems have no locks.
    checked(H5Pset_file_locking(access, false, true), "set", "file locking");
    return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose, "open", "the file"};
  } catch (const Hdf5Error&) {
    std::throw_with_nested(
        InputError("expected a whole HDF5 file, got one that does not open, in " + path.string()));
  }
}

Hdf5Table open_events(hid_t file, const Hdf5Layout& layout, const std::string& name) {
  Hdf5Table events(file, layout.events, name);
  if (!events.is_float() || events.dims().size() != 2 || events.dims()[1] != 4) {
    events.refuse("float32 or float64 [events, 4] of x, y, t, p");
  }
  return events;
}

Hdf5Table open_frames(hid_t file, const Hdf5Layout& layout, const std::string& name) {
  Hdf5Table frames(file, layout.frames, name);
  if (frames.dims().size() == 4) {
    frames.refuse("grey pictures, uint8 [frames, height, width], and no colour");
  }
  if (!frames.is_uint8() || frames.dims().size() != 3) {
    frames.refuse("grey pictures, uint8 [frames, height, width]");
  }
  const hsize_t height = frames.dims()[1];
  const hsize_t width = frames.dims()[2];
  if (height == 0 || width == 0 || height > kMaxPicturePixels / width) {
    frames.refuse("pictures of 1 to " + std::to_string(kMaxPicturePixels) + " pixels");
  }
  return frames;
}

/// A whole column of `count` numbers.
template <class Number>
std::vector<Number> read_column(const Hdf5Table& column, hsize_t count, const char* what) {
  const bool right_type = column.is_float() == std::is_floating_point_v<Number>;
  if (!right_type || column.dims() != Dims{count}) {
    column.refuse(std::string(what) + " [" + std::to_string(count) + "]");
  }
  std::vector<Number> values(count);
  try {
    if (count > 0) column.read({0}, {count}, values.data());
  } catch (const Hdf5Error&) {
    std::throw_with_nested(
        InputError("expected readable values, got damage, in " + column.place()));
  }
  return values;
}

std::vector<double> read_frame_times(hid_t file, const Hdf5Layout& layout, const std::string& name,
                                     hsize_t frame_count) {
  const Hdf5Table table(file, layout.frame_times, name);
  std::vector<double> times_s =
      read_column<double>(table, frame_count, "a time for each frame, float");
  check_frame_times(times_s, table.place());
  return times_s;
}

std::vector<std::int64_t> read_event_index(hid_t file, const Hdf5Layout& layout,
                                           const std::string& name, hsize_t frame_count) {
  if (!has_object(file, layout.event_index)) return {};
  return read_column<std::int64_t>(Hdf5Table(file, layout.event_index, name), frame_count,
                                   "an event's index for each frame, integer");
}

std::optional<Hdf5Table> open_flow(hid_t file, const Hdf5Layout& layout, const std::string& name,
                                   const Dims& frames) {
  if (layout.flow.empty() || !has_object(file, layout.flow)) return std::nullopt;
  Hdf5Table flow(file, layout.flow, name);
  if (!flow.is_float() || flow.dims() != Dims{frames[0] - 1, 2, frames[1], frames[2]}) {
    flow.refuse("the flow of each interval between frames, float [" +
                std::to_string(frames[0] - 1) + ", 2, " + std::to_string(frames[1]) + ", " +
                std::to_string(frames[2]) + "]");
  }
  return flow;
}

}  // namespace

Hdf5RecordingTables open_hdf5_recording_tables(const std::filesystem::path& path,
                                               const Hdf5Layout& layout) {
  const std::string name = path.string();
  Hdf5Handle file = open_file(path);
  Hdf5Table events = open_events(file, layout, name);
  Hdf5Table frames = open_frames(file, layout, name);
  const Dims dims = frames.dims();
  std::vector<double> times_s = read_frame_times(file, layout, name, dims[0]);
  std::vector<std::int64_t> event_index = read_event_index(file, layout, name, dims[0]);
  std::optional<Hdf5Table> flow = open_flow(file, layout, name, dims);
  return {std::move(file),
          std::move(events),
          std::move(frames),
          std::move(flow),
          {static_cast<int>(dims[1]), static_cast<int>(dims[2])},
          std::move(times_s),
          std::move(event_index)};
}

}  // namespace eventgan

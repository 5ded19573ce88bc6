#include "stages/hdf5/hdf5_attribute_internal.h"
#include "stages/hdf5/hdf5_dataset_internal.h"
#include "stages/recordings/hdf5_layout_internal.h"
#include "stages/recordings/mvsec_file_internal.h"

namespace eventgan {
namespace {

// Events are chunked by column, since x, y, t and p compress best each among its like.
constexpr hsize_t kEventsPerChunk = 32768;
constexpr char kCamera[] = "left";

hsize_t height(ImageSize size) { return static_cast<hsize_t>(size.height); }
hsize_t width(ImageSize size) { return static_cast<hsize_t>(size.width); }

void make_group(hid_t file, const std::string& path) {
  const Hdf5Handle creation = creation_properties(H5P_GROUP_CREATE);
  Hdf5Handle group(H5Gcreate2(file, path.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), H5Gclose,
                   "create", path);
  group.close(path);
}

}  // namespace

MvsecFile::MvsecFile(const std::filesystem::path& path, ImageSize size, const std::string& settings)
    : size_(size), file_(path, creation_properties(H5P_FILE_CREATE)) {
  write_attribute(file_.id(), "simulation", settings);
  make_group(file_.id(), "davis");
  make_group(file_.id(), std::string("davis/") + kCamera);
  const Hdf5Layout layout = mvsec_layout(kCamera);
  events_.emplace(file_.id(), layout.events, Dims{4}, Dims{kEventsPerChunk, 1}, kEventsPerChunk);
  const Dims picture{height(size), width(size)};
  frames_.emplace(file_.id(), layout.frames, picture, Dims{1, picture[0], picture[1]}, 1);
}

void MvsecFile::append_flow(std::span<const float> x_px, std::span<const float> y_px) {
  if (!flow_) {
    const Dims field{2, height(size_), width(size_)};
    flow_.emplace(file_.id(), mvsec_layout(kCamera).flow, field, Dims{1, 1, field[1], field[2]}, 1);
  }
  flow_->append(x_px);
  flow_->append(y_px);
}

void MvsecFile::close(const std::vector<double>& times_s,
                      const std::vector<std::int64_t>& event_index) {
  const Hdf5Layout layout = mvsec_layout(kCamera);
  events_->close();
  frames_->close();
  if (flow_) flow_->close();
  write_dataset(file_.id(), layout.frame_times, times_s, {times_s.size()}, kRecordingDeflateLevel);
  write_dataset(file_.id(), layout.event_index, event_index, {event_index.size()},
                kRecordingDeflateLevel);
  file_.close();
}

}  // namespace eventgan

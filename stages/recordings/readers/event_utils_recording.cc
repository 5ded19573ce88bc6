#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/readers/detail/event_columns.h"
#include "stages/recordings/readers/detail/frame_intervals.h"
#include "stages/recordings/readers/detail/hdf5_table.h"
#include "stages/recordings/readers/detail/image_frames.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

// HDF5 as event_utils writes it (lib/data_formats/event_packagers.py), and HQF, EVREAL and others
// with it: events/{xs, ys, ts, ps}, ts in seconds, and images/image000000000, ... with the
// attribute timestamp; the file's attribute sensor_resolution is height and width, and perhaps
// channels. event-vision-library writes raw_events/{x, y, t, p}, t in seconds, alone.

constexpr char kImages[] = "images";

const std::array<ColumnLayout, 2>& layouts() {
  static const std::array<ColumnLayout, 2> kLayouts{
      {{.events = "events", .ending = "s", .counts_seconds = true},
       {.events = "raw_events", .counts_seconds = true}}};
  return kLayouts;
}

std::optional<ImageSize> told_size(hid_t file, const std::string& name) {
  const std::vector<double> sides = read_attribute(file, "sensor_resolution", 16, name);
  if (sides.size() < 2) return std::nullopt;
  return told_sensor(sides[0], sides[1], name + " (attribute sensor_resolution)");
}

/// The images' names in their order, which is that of their numbers of nine digits.
std::vector<std::string> image_names(hid_t file) {
  std::vector<std::string> names;
  if (!has_object(file, kImages)) return names;
  const Hdf5Handle group = open_object(file, kImages);
  H5G_info_t info;
  checked(H5Gget_info(group, &info), "look into", kImages);
  for (hsize_t i = 0; i < info.nlinks; ++i) {
    std::array<char, 64> name{};
    checked(H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(),
                               H5P_DEFAULT),
            "read a name in", kImages);
    names.push_back(fmt::format("{}/{}", kImages, name.data()));
  }
  return names;
}

/// Grey or BGR images, a dataset each.
class ImageDatasets final : public FrameStore {
 public:
  ImageDatasets(const std::filesystem::path& path, ImageSize size)
      : name_(path.string()), size_(size), file_([path] { return open_recording_file(path); }) {
    const auto file = file_.get();
    images_ = image_names(*file);
    for (const std::string& image : images_) {
      const Hdf5Handle dataset = open_object(*file, image);
      const std::vector<double> time_s =
          read_attribute(dataset, "timestamp", 1, fmt::format("{} ({})", name_, image));
      if (time_s.empty()) {
        throw InputError(fmt::format("expected a time, got none, in {} ({}, attribute timestamp)",
                                     name_, image));
      }
      times_s_.push_back(time_s[0]);
    }
    if (!times_s_.empty()) check_frame_times(times_s_, fmt::format("{} ({})", name_, kImages));
  }

  const std::vector<double>& times_s() const override { return times_s_; }

  GreyImage read(std::int64_t index) const override {
    const std::string& image = images_[static_cast<std::size_t>(index)];
    return read_hdf5(fmt::format("{} ({})", name_, image), [&] {
      const auto file = file_.get();
      const Hdf5Table table(*file, image, name_);
      const Dims height_and_width{static_cast<hsize_t>(size_.height),
                                  static_cast<hsize_t>(size_.width)};
      Dims dims = table.dims();
      const bool has_channels = dims.size() == 3 && (dims[2] == 1 || dims[2] == 3);
      const hsize_t channels = has_channels ? dims[2] : 1;
      if (has_channels) dims.pop_back();
      if (!table.is_uint8() || dims != height_and_width) {
        table.refuse(fmt::format("an image of {}, uint8 [{}, {}] or [{}, {}, 3]", to_string(size_),
                                 size_.height, size_.width, size_.height, size_.width));
      }
      std::vector<std::uint8_t> values(size_.pixel_count() * channels);
      table.read(Dims(table.dims().size(), 0), table.dims(), values.data());
      if (channels == 1) return GreyImage{size_, std::move(values)};
      bool has_colour = false;
      GreyImage grey = grey_of({size_, std::move(values)}, has_colour);
      if (has_colour) in_colour_ = true;
      return grey;
    });
  }

  std::vector<std::string> notes() const override {
    if (!in_colour_) return {};
    return {"frames in colour are made grey, in " + name_};
  }

 private:
  std::string name_;
  ImageSize size_;
  OpenedAtUse<Hdf5Handle> file_;
  std::vector<std::string> images_;
  std::vector<double> times_s_;
  mutable std::atomic<bool> in_colour_ = false;
};

std::unique_ptr<Recording> open_event_utils(const std::filesystem::path& path,
                                            const RecordingOptions& options) {
  const std::string name = path.string();
  RecordingOptions sized = options;
  std::vector<std::string> warnings;
  if (const auto told =
          read_hdf5(name, [&] { return told_size(open_recording_file(path), name); })) {
    StoredParts parts;
    parts.name = name;
    sized.sensor = sensor_size(told, options.sensor, parts);
    warnings = std::move(parts.warnings);
  }
  const RecordingInput input(path);
  const bool is_raw = input.has_hdf5_dataset(layouts()[1].column("t"));
  StoredParts parts = open_event_columns(path, layouts()[is_raw ? 1 : 0], sized);
  parts.warnings = std::move(warnings);
  auto frames = read_hdf5(name, [&] { return std::make_unique<ImageDatasets>(path, parts.size); });
  if (!frames->times_s().empty()) parts.frames = std::move(frames);
  return make_stored_recording(std::move(parts));
}

}  // namespace

constinit const RecordingReader kEventUtilsReader{
    .format = RecordingFormat::kEventUtils,
    .fits =
        [](const RecordingInput& input, const RecordingOptions&) {
          return std::ranges::any_of(layouts(), [&](const ColumnLayout& layout) {
            return input.has_hdf5_dataset(layout.column("t"));
          });
        },
    .open = open_event_utils};

}  // namespace eventgan

#include "stages/recordings/detail/hdf5_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/detail/frame_intervals.h"
#include "stages/recordings/detail/hdf5_table.h"
#include "stages/recordings/detail/recording_reader.h"
#include "stages/recordings/detail/stored_recording.h"

namespace eventgan {
namespace {

constexpr hsize_t kTimeColumn = 2;

/// The datasets of a recording, of which it is known that they fit together.
struct Hdf5RecordingTables {
  Hdf5Handle file;  ///< first, so that it closes last
  Hdf5Table events;
  Hdf5Table frames;
  std::optional<Hdf5Table> flow;
  ImageSize size;
  std::vector<double> frame_times_s;
};

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
    frames.refuse("grey images, uint8 [frames, height, width], and no colour");
  }
  if (!frames.is_uint8() || frames.dims().size() != 3) {
    frames.refuse("grey images, uint8 [frames, height, width]");
  }
  const hsize_t height = frames.dims()[1];
  const hsize_t width = frames.dims()[2];
  if (height == 0 || width == 0 || height > kMaxImagePixels / width) {
    frames.refuse("images of 1 to " + std::to_string(kMaxImagePixels) + " pixels");
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

/// Throws InputError, the cause nested.
Hdf5RecordingTables open_tables(const std::filesystem::path& path, const Hdf5Layout& layout) {
  const Hdf5Lock lock;
  const std::string name = path.string();
  Hdf5Handle file = open_recording_file(path);
  Hdf5Table events = open_events(file, layout, name);
  Hdf5Table frames = open_frames(file, layout, name);
  const Dims dims = frames.dims();
  std::vector<double> times_s = read_frame_times(file, layout, name, dims[0]);
  std::optional<Hdf5Table> flow = open_flow(file, layout, name, dims);
  return {std::move(file),
          std::move(events),
          std::move(frames),
          std::move(flow),
          {static_cast<int>(dims[1]), static_cast<int>(dims[2])},
          std::move(times_s)};
}

class Hdf5Events final : public EventStore {
 public:
  Hdf5Events(std::shared_ptr<const Hdf5RecordingTables> tables, std::string name)
      : tables_(std::move(tables)), name_(std::move(name)) {}

  std::int64_t count() const override {
    return static_cast<std::int64_t>(tables_->events.dims()[0]);
  }

  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const override {
    static_assert(sizeof(StoredEvent) == 4 * sizeof(double), "a row of the dataset");
    std::vector<StoredEvent> rows(static_cast<std::size_t>(count));
    read_block(first, rows.size(), 0, 4, rows.empty() ? nullptr : &rows.data()->x);
    return rows;
  }

  std::vector<double> times_s(std::int64_t first, std::int64_t count) const override {
    std::vector<double> times(static_cast<std::size_t>(count));
    read_block(first, times.size(), kTimeColumn, 1, times.data());
    return times;
  }

 private:
  void read_block(std::int64_t first, hsize_t rows, hsize_t column, hsize_t columns,
                  double* values) const {
    read_hdf5(
        fmt::format("{} (events {}..{})", name_, first,
                    first + static_cast<std::int64_t>(rows) - 1),
        [&] {
          tables_->events.read({static_cast<hsize_t>(first), column}, {rows, columns}, values);
        });
  }

  std::shared_ptr<const Hdf5RecordingTables> tables_;
  std::string name_;
};

class Frames final : public FrameStore {
 public:
  Frames(std::shared_ptr<const Hdf5RecordingTables> tables, std::string name)
      : tables_(std::move(tables)), name_(std::move(name)) {}

  const std::vector<double>& times_s() const override { return tables_->frame_times_s; }

  GreyImage read(std::int64_t index) const override {
    const ImageSize size = tables_->size;
    GreyImage image{size, std::vector<std::uint8_t>(size.pixel_count())};
    const Dims& dims = tables_->frames.dims();
    read_hdf5(fmt::format("{} (frame {})", name_, index), [&] {
      tables_->frames.read({static_cast<hsize_t>(index), 0, 0}, {1, dims[1], dims[2]},
                           image.pixels.data());
    });
    return image;
  }

  std::optional<FlowField> flow(std::int64_t index) const override {
    if (!tables_->flow) return std::nullopt;
    const std::size_t count = tables_->size.pixel_count();
    FlowField field{tables_->size, std::vector<float>(count), std::vector<float>(count)};
    const Dims& dims = tables_->flow->dims();
    const auto row = static_cast<hsize_t>(index);
    const std::string place = fmt::format("{} (flow of frame {})", name_, index);
    read_hdf5(place, [&] {
      tables_->flow->read({row, 0, 0, 0}, {1, 1, dims[2], dims[3]}, field.x_px.data());
      tables_->flow->read({row, 1, 0, 0}, {1, 1, dims[2], dims[3]}, field.y_px.data());
    });
    const auto finite = [](float value) { return std::isfinite(value); };
    if (!std::ranges::all_of(field.x_px, finite) || !std::ranges::all_of(field.y_px, finite)) {
      throw InputError("expected finite values, got others, in " + place);
    }
    return field;
  }

 private:
  std::shared_ptr<const Hdf5RecordingTables> tables_;
  std::string name_;
};

}  // namespace

Hdf5Layout mvsec_layout(const std::string& camera) {
  const std::string group = "davis/" + camera + "/";
  return {group + "events", group + "image_raw", group + "image_raw_ts",
          group + "image_raw_event_inds", group + "flow_dist"};
}

Hdf5Layout eventgan_layout() {
  return {"davis/events/data", "davis/image_raw/data", "davis/image_raw/timestamps",
          "davis/image_raw/event_index", ""};
}

std::unique_ptr<Recording> open_hdf5_recording(const std::filesystem::path& path,
                                               const Hdf5Layout& layout) {
  const auto tables = std::make_shared<const Hdf5RecordingTables>(open_tables(path, layout));
  return make_stored_recording({.name = path.string(),
                                .size = tables->size,
                                .events = std::make_unique<Hdf5Events>(tables, path.string()),
                                .frames = std::make_unique<Frames>(tables, path.string())});
}

constinit const RecordingReader kMvsecReader{
    .format = RecordingFormat::kMvsec,
    .fits =
        [](const RecordingInput& input, const RecordingOptions& options) {
          return input.has_hdf5_object(mvsec_layout(options.camera).events);
        },
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return open_hdf5_recording(path, mvsec_layout(options.camera));
        }};

constinit const RecordingReader kEventganReader{
    .format = RecordingFormat::kEventgan,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.has_hdf5_object(eventgan_layout().events); },
    .open = [](const std::filesystem::path& path,
               const RecordingOptions&) { return open_hdf5_recording(path, eventgan_layout()); }};

}  // namespace eventgan

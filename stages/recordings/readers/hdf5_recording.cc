#include "stages/recordings/readers/detail/hdf5_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/readers/detail/frame_intervals.h"
#include "stages/recordings/readers/detail/hdf5_table.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

/// The datasets of a recording, of which it is known that they fit together.
struct Hdf5RecordingTables {
  Hdf5Handle file;  ///< first, so that it closes last
  Hdf5Table events;
  std::optional<Hdf5Table> frames;
  std::optional<Hdf5Table> flow;
};

bool counts_seconds(const Hdf5Layout& layout) { return layout.ticks_per_s == 1; }

Hdf5Table open_events(hid_t file, const Hdf5Layout& layout, const std::string& name) {
  Hdf5Table events(file, layout.events, name);
  if (events.is_float() != counts_seconds(layout) || events.dims().size() != 2 ||
      events.dims()[1] != layout.columns.size()) {
    events.refuse(counts_seconds(layout) ? "float32 or float64 [events, 4] of x, y, t, p"
                                         : "whole numbers [events, 4] of t, x, y, p");
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

std::vector<double> read_frame_times(hid_t file, const Hdf5Layout& layout, const std::string& name,
                                     hsize_t frame_count) {
  const Hdf5Table table(file, layout.frame_times, name);
  if (table.is_float() != counts_seconds(layout) || table.dims() != Dims{frame_count}) {
    table.refuse(fmt::format("a time for each frame, {} [{}]",
                             counts_seconds(layout) ? "float" : "whole numbers", frame_count));
  }
  std::vector<double> times_s(frame_count);
  read_hdf5(table.place(), [&] {
    if (frame_count > 0) table.read({0}, {frame_count}, times_s.data());
  });
  for (double& time_s : times_s) time_s /= layout.ticks_per_s;
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

Hdf5RecordingTables open_tables(const std::filesystem::path& path, const Hdf5Layout& layout) {
  const std::string name = path.string();
  Hdf5Handle file = open_recording_file(path);
  Hdf5Table events = open_events(file, layout, name);
  Hdf5RecordingTables tables{std::move(file), std::move(events), {}, {}};
  if (!layout.may_lack_frames || has_object(tables.file, layout.frames)) {
    tables.frames = open_frames(tables.file, layout, name);
    const bool has_intervals = tables.frames->dims()[0] > 0;
    if (has_intervals) tables.flow = open_flow(tables.file, layout, name, tables.frames->dims());
  }
  return tables;
}

/// A file's tables, whose shapes stay as they were.
class Hdf5RecordingFile {
 public:
  /// Throws InputError, the cause nested.
  Hdf5RecordingFile(const std::filesystem::path& path, const Hdf5Layout& layout)
      : layout_(layout), name_(path.string()), tables_([this, path] {
          Hdf5RecordingTables tables = open_tables(path, layout_);
          const Dims frames = tables.frames ? tables.frames->dims() : Dims();
          if (!events_.empty() && (tables.events.dims() != events_ || frames != frames_)) {
            throw InputError("expected as many events and frames as before, got others, in " +
                             name_);
          }
          return tables;
        }) {
    const Hdf5Lock lock;
    const auto tables = tables_.get();
    events_ = tables->events.dims();
    if (!tables->frames) return;
    frames_ = tables->frames->dims();
    frame_times_s_ = read_frame_times(tables->file, layout, name_, frames_[0]);
  }

  const std::string& name() const { return name_; }
  const Hdf5Layout& layout() const { return layout_; }
  std::int64_t event_count() const { return static_cast<std::int64_t>(events_[0]); }
  /// None if there are no frames.
  std::optional<ImageSize> size() const {
    if (frames_.empty()) return std::nullopt;
    return ImageSize{static_cast<int>(frames_[1]), static_cast<int>(frames_[2])};
  }
  const std::vector<double>& frame_times_s() const { return frame_times_s_; }

  /// Under HDF5's lock.
  std::shared_ptr<const Hdf5RecordingTables> tables() const { return tables_.get(); }

 private:
  Hdf5Layout layout_;
  std::string name_;
  Dims events_;  ///< empty until it was opened
  Dims frames_;  ///< empty: there are none
  std::vector<double> frame_times_s_;
  OpenedAtUse<Hdf5RecordingTables> tables_;
};

class Hdf5Events final : public EventStore {
 public:
  explicit Hdf5Events(std::shared_ptr<const Hdf5RecordingFile> file) : file_(std::move(file)) {}

  std::int64_t count() const override { return file_->event_count(); }

  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const override {
    using Row = std::array<double, 4>;
    std::vector<Row> rows(static_cast<std::size_t>(count));
    read_block(first, rows.size(), 0, 4, rows.empty() ? nullptr : rows.data()->data());
    const auto [x, y, t, p] = file_->layout().columns;
    const double ticks_per_s = file_->layout().ticks_per_s;
    std::vector<StoredEvent> events(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      events[i] = {rows[i][x], rows[i][y], rows[i][t] / ticks_per_s, rows[i][p]};
    }
    return events;
  }

  std::vector<double> times_s(std::int64_t first, std::int64_t count) const override {
    std::vector<double> times(static_cast<std::size_t>(count));
    read_block(first, times.size(), file_->layout().columns[2], 1, times.data());
    for (double& time_s : times) time_s /= file_->layout().ticks_per_s;
    return times;
  }

 private:
  void read_block(std::int64_t first, hsize_t rows, hsize_t column, hsize_t columns,
                  double* values) const {
    read_hdf5(fmt::format("{} (events {}..{})", file_->name(), first,
                          first + static_cast<std::int64_t>(rows) - 1),
              [&] {
                file_->tables()->events.read({static_cast<hsize_t>(first), column}, {rows, columns},
                                             values);
              });
  }

  std::shared_ptr<const Hdf5RecordingFile> file_;
};

class Frames final : public FrameStore {
 public:
  explicit Frames(std::shared_ptr<const Hdf5RecordingFile> file)
      : file_(std::move(file)), size_(*file_->size()) {}

  const std::vector<double>& times_s() const override { return file_->frame_times_s(); }

  GreyImage read(std::int64_t index) const override {
    GreyImage image{size_, std::vector<std::uint8_t>(size_.pixel_count())};
    read_hdf5(fmt::format("{} (frame {})", file_->name(), index), [&] {
      file_->tables()->frames->read({static_cast<hsize_t>(index), 0, 0}, {1, height(), width()},
                                    image.pixels.data());
    });
    return image;
  }

  std::optional<FlowField> flow(std::int64_t index) const override {
    const std::size_t count = size_.pixel_count();
    FlowField field{size_, std::vector<float>(count), std::vector<float>(count)};
    const auto row = static_cast<hsize_t>(index);
    const std::string place = fmt::format("{} (flow of frame {})", file_->name(), index);
    const bool has_flow = read_hdf5(place, [&] {
      const auto tables = file_->tables();
      if (!tables->flow) return false;
      tables->flow->read({row, 0, 0, 0}, {1, 1, height(), width()}, field.x_px.data());
      tables->flow->read({row, 1, 0, 0}, {1, 1, height(), width()}, field.y_px.data());
      return true;
    });
    if (!has_flow) return std::nullopt;
    const auto finite = [](float value) { return std::isfinite(value); };
    if (!std::ranges::all_of(field.x_px, finite) || !std::ranges::all_of(field.y_px, finite)) {
      throw InputError("expected finite values, got others, in " + place);
    }
    return field;
  }

 private:
  hsize_t height() const { return static_cast<hsize_t>(size_.height); }
  hsize_t width() const { return static_cast<hsize_t>(size_.width); }

  std::shared_ptr<const Hdf5RecordingFile> file_;
  ImageSize size_;
};

}  // namespace

std::unique_ptr<Recording> open_hdf5_recording(const std::filesystem::path& path,
                                               const Hdf5Layout& layout,
                                               const std::optional<ImageSize>& sensor) {
  std::string index_key = hdf5_index_key(path, layout.events);
  const auto file = std::make_shared<const Hdf5RecordingFile>(path, layout);
  StoredParts parts{
      .name = path.string(), .size = {}, .events = std::make_unique<Hdf5Events>(file)};
  std::optional<ImageSize> told = file->size();
  if (!told && !sensor) {
    told = read_hdf5(parts.name, [&] {
      return attribute_size(file->tables()->file, layout.events, parts.name);
    });
  }
  parts.size = sensor_size(told, sensor, parts);
  parts.index_key = std::move(index_key);
  if (file->size() == parts.size) parts.frames = std::make_unique<Frames>(file);
  return make_stored_recording(std::move(parts));
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

constinit const RecordingReader kV2eReader{
    .format = RecordingFormat::kV2e,
    .fits = [](const RecordingInput& input,
               const RecordingOptions&) { return input.has_hdf5_dataset(v2e_layout().events); },
    .open =
        [](const std::filesystem::path& path, const RecordingOptions& options) {
          return open_hdf5_recording(path, v2e_layout(), options.sensor);
        }};

}  // namespace eventgan

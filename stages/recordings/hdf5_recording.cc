#include "stages/recordings/detail/hdf5_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/detail/frame_intervals.h"

namespace eventgan {
namespace {

constexpr std::int64_t kEventsPerRead = std::int64_t{1} << 17;
constexpr hsize_t kTimeColumn = 2;

Hdf5Handle open_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw InputError("expected an HDF5 file, got " +
                     std::string(std::filesystem::exists(path, ignored) ? "a folder" : "none") +
                     ", in " + path.string());
  }
  try {
    return open_hdf5_file(path);
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

/// Throws InputError, the cause nested.
Hdf5RecordingTables open_tables(const std::filesystem::path& path, const Hdf5Layout& layout) {
  const Hdf5Lock lock;
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

Hdf5Recording::Hdf5Recording(const std::filesystem::path& path, const Hdf5Layout& layout)
    : name_(path.string()),
      tables_(open_tables(path, layout)),
      boundaries_(tables_.frame_times_s.size()) {}

template <class Read>
auto Hdf5Recording::read_locked(const std::string& what, Read read) const {
  const Hdf5Lock lock;
  try {
    return read();
  } catch (const Hdf5Error&) {
    std::throw_with_nested(
        InputError("expected readable values, got damage, in " + name_ + " (" + what + ")"));
  }
}

double Hdf5Recording::frame_time_s(std::int64_t index) const {
  return tables_.frame_times_s[frame_position(index, frame_count(), name_)];
}

GreyImage Hdf5Recording::frame(std::int64_t index) const {
  const hsize_t row = frame_position(index, frame_count(), name_);
  GreyImage image{size(), std::vector<std::uint8_t>(size().pixel_count())};
  const Dims& dims = tables_.frames.dims();
  read_locked("frame " + std::to_string(index), [&] {
    tables_.frames.read({row, 0, 0}, {1, dims[1], dims[2]}, image.pixels.data());
  });
  return image;
}

std::optional<FlowField> Hdf5Recording::flow(std::int64_t index) const {
  const hsize_t row = frame_position(index, frame_count() - 1, name_);
  if (!tables_.flow) return std::nullopt;
  const std::size_t count = size().pixel_count();
  FlowField field{size(), std::vector<float>(count), std::vector<float>(count)};
  const Dims& dims = tables_.flow->dims();
  const std::string what = "flow of frame " + std::to_string(index);
  read_locked(what, [&] {
    tables_.flow->read({row, 0, 0, 0}, {1, 1, dims[2], dims[3]}, field.x_px.data());
    tables_.flow->read({row, 1, 0, 0}, {1, 1, dims[2], dims[3]}, field.y_px.data());
  });
  const auto finite = [](float value) { return std::isfinite(value); };
  if (!std::ranges::all_of(field.x_px, finite) || !std::ranges::all_of(field.y_px, finite)) {
    throw InputError("expected finite values, got others, in " + name_ + " (" + what + ")");
  }
  return field;
}

std::vector<Event> Hdf5Recording::events_between(std::int64_t first_frame,
                                                 std::int64_t last_frame) const {
  const auto [first, last] = frame_range(first_frame, last_frame, frame_count(), name_);
  const std::string what =
      "events of frames " + std::to_string(first_frame) + ".." + std::to_string(last_frame);
  const double after_s = frame_time_s(first_frame);
  const double until_s = frame_time_s(last_frame);
  return read_locked(what, [&, first = first, last = last] {
    return read_events(events_until(first), events_until(last),
                       EventCheck(size(), after_s, until_s));
  });
}

std::vector<Event> Hdf5Recording::events_in(double after_s, double until_s) const {
  return read_locked(fmt::format("events of {} s to {} s", after_s, until_s), [&] {
    return read_events(events_until_time(after_s), events_until_time(until_s),
                       EventCheck(size(), after_s, until_s));
  });
}

std::vector<Event> Hdf5Recording::events_around(double time_s, std::int64_t before,
                                                std::int64_t after) const {
  return read_locked(fmt::format("events around {} s", time_s), [&] {
    const std::int64_t middle = events_until_time(time_s);
    return read_events(std::max<std::int64_t>(middle - before, 0),
                       middle + std::min(after, event_count() - middle),
                       EventCheck::of_any_time(size()));
  });
}

std::optional<std::array<double, 2>> Hdf5Recording::event_span() const {
  if (event_count() == 0) return std::nullopt;
  return read_locked("first and last event", [&] {
    return std::array{event_times(0, 1)[0], event_times(event_count() - 1, 1)[0]};
  });
}

/// The frame before tells where to look first.
std::int64_t Hdf5Recording::events_until_time(double time_s) const {
  const std::vector<double>& frames = tables_.frame_times_s;
  const auto next = std::ranges::upper_bound(frames, time_s);
  const std::int64_t guess =
      next == frames.begin() ? 0
                             : events_until(static_cast<std::size_t>(next - frames.begin()) - 1);
  return count_events_until(
      time_s, guess, event_count(),
      [&](std::int64_t begin, std::int64_t count) { return event_times(begin, count); });
}

std::int64_t Hdf5Recording::events_until(std::size_t frame) const {
  return boundaries_.at(frame, [&] {
    const std::vector<std::int64_t>& index = tables_.event_index;
    const std::int64_t guess = index.empty() ? event_count() / 2 : index[frame];
    return count_events_until(
        tables_.frame_times_s[frame], guess, event_count(),
        [&](std::int64_t begin, std::int64_t count) { return event_times(begin, count); });
  });
}

std::vector<double> Hdf5Recording::event_times(std::int64_t first, std::int64_t count) const {
  const auto rows = static_cast<hsize_t>(count);
  std::vector<double> times(rows);
  tables_.events.read({static_cast<hsize_t>(first), kTimeColumn}, {rows, 1}, times.data());
  // Among times out of order a search would find a wrong place and nobody would know.
  std::size_t at = 0;
  try {
    for (; at < times.size(); ++at) check_event_time(times[at == 0 ? 0 : at - 1], times[at]);
  } catch (const EventFault& fault) {
    refuse(fault, first + static_cast<std::int64_t>(at));
  }
  return times;
}

void Hdf5Recording::refuse(const EventFault& fault, std::int64_t event) const {
  throw InputError(std::string(fault.what()) + ", in " + name_ + " (event " +
                   std::to_string(event) + ")");
}

std::vector<Event> Hdf5Recording::read_events(std::int64_t begin, std::int64_t end,
                                              EventCheck check) const {
  if (end < begin) {
    throw InputError("expected times that never fall, got others, in " + name_ + " (events " +
                     std::to_string(end) + ".." + std::to_string(begin) + ")");
  }
  std::vector<Event> events;
  events.reserve(static_cast<std::size_t>(end - begin));
  std::vector<StoredEvent> rows;
  std::int64_t next = begin;
  try {
    while (next < end) {
      rows.resize(static_cast<std::size_t>(std::min(kEventsPerRead, end - next)));
      static_assert(sizeof(StoredEvent) == 4 * sizeof(double), "a row of the dataset");
      tables_.events.read({static_cast<hsize_t>(next), 0}, {rows.size(), 4}, &rows.data()->x);
      for (const StoredEvent& row : rows) {
        events.push_back(check.take(row));
        ++next;
      }
    }
  } catch (const EventFault& fault) {
    refuse(fault, next);
  }
  return events;
}

}  // namespace eventgan

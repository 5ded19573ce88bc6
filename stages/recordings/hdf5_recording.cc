#include <algorithm>
#include <cmath>
#include <utility>

#include "manifests/faults.h"
#include "stages/recordings/frame_range_internal.h"
#include "stages/recordings/hdf5_recording_internal.h"
#include "stages/recordings/hdf5_turn_internal.h"

namespace eventgan {
namespace {

constexpr std::int64_t kEventsPerRead = std::int64_t{1} << 17;
constexpr hsize_t kTimeColumn = 2;

/// Within a turn from the first handle to the last.
Hdf5RecordingTables open_in_turn(const std::filesystem::path& path, const Hdf5Layout& layout) {
  const Hdf5Turn turn;
  return open_hdf5_recording_tables(path, layout);
}

}  // namespace

Hdf5Recording::Hdf5Recording(const std::filesystem::path& path, const Hdf5Layout& layout)
    : name_(path.string()),
      tables_(open_in_turn(path, layout)),
      boundaries_(tables_->frame_times_s.size()) {}

Hdf5Recording::~Hdf5Recording() {
  const Hdf5Turn turn;
  tables_.reset();
}

template <class Read>
auto Hdf5Recording::read_in_turn(const std::string& what, Read read) const {
  const Hdf5Turn turn;
  try {
    return read();
  } catch (const Hdf5Error&) {
    std::throw_with_nested(
        InputError("expected readable values, got damage, in " + name_ + " (" + what + ")"));
  }
}

double Hdf5Recording::frame_time_s(std::int64_t index) const {
  return tables_->frame_times_s[frame_position(index, frame_count(), name_)];
}

GreyImage Hdf5Recording::frame(std::int64_t index) const {
  const hsize_t row = frame_position(index, frame_count(), name_);
  GreyImage image{size(), std::vector<std::uint8_t>(size().pixel_count())};
  const Dims& dims = tables_->frames.dims();
  read_in_turn("frame " + std::to_string(index), [&] {
    tables_->frames.read({row, 0, 0}, {1, dims[1], dims[2]}, image.pixels.data());
  });
  return image;
}

std::optional<FlowField> Hdf5Recording::flow(std::int64_t index) const {
  const hsize_t row = frame_position(index, frame_count() - 1, name_);
  if (!tables_->flow) return std::nullopt;
  const std::size_t count = size().pixel_count();
  FlowField field{size(), std::vector<float>(count), std::vector<float>(count)};
  const Dims& dims = tables_->flow->dims();
  const std::string what = "flow of frame " + std::to_string(index);
  read_in_turn(what, [&] {
    tables_->flow->read({row, 0, 0, 0}, {1, 1, dims[2], dims[3]}, field.x_px.data());
    tables_->flow->read({row, 1, 0, 0}, {1, 1, dims[2], dims[3]}, field.y_px.data());
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
  return read_in_turn(what, [&, first = first, last = last] {
    return read_events(events_until(first), events_until(last), after_s, until_s);
  });
}

std::int64_t Hdf5Recording::events_until(std::size_t frame) const {
  return boundaries_.at(frame, [&] {
    const std::vector<std::int64_t>& index = tables_->event_index;
    const std::int64_t guess = index.empty() ? event_count() / 2 : index[frame];
    return count_events_until(
        tables_->frame_times_s[frame], guess, event_count(),
        [&](std::int64_t begin, std::int64_t count) { return event_times(begin, count); });
  });
}

std::vector<double> Hdf5Recording::event_times(std::int64_t first, std::int64_t count) const {
  const auto rows = static_cast<hsize_t>(count);
  std::vector<double> times(rows);
  tables_->events.read({static_cast<hsize_t>(first), kTimeColumn}, {rows, 1}, times.data());
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

std::vector<Event> Hdf5Recording::read_events(std::int64_t begin, std::int64_t end, double after_s,
                                              double until_s) const {
  if (end < begin) {
    throw InputError("expected times that never fall, got others, in " + name_ + " (events " +
                     std::to_string(end) + ".." + std::to_string(begin) + ")");
  }
  std::vector<Event> events;
  events.reserve(static_cast<std::size_t>(end - begin));
  std::vector<StoredEvent> rows;
  EventCheck check(size(), after_s, until_s);
  std::int64_t next = begin;
  try {
    while (next < end) {
      rows.resize(static_cast<std::size_t>(std::min(kEventsPerRead, end - next)));
      static_assert(sizeof(StoredEvent) == 4 * sizeof(double), "a row of the dataset");
      tables_->events.read({static_cast<hsize_t>(next), 0}, {rows.size(), 4}, &rows.data()->x);
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

#include "stages/recordings/writers/mvsec_writer.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "stages/base/hdf5/hdf5_output_file.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/hdf5_layouts.h"
#include "stages/recordings/writers/detail/growing_dataset.h"
#include "stages/recordings/writers/detail/require.h"

namespace eventgan {
namespace {

constexpr char kCamera[] = "left";
constexpr double kBeforeAll = -std::numeric_limits<double>::infinity();
constexpr double kAfterAll = std::numeric_limits<double>::max();

bool is_field(const FlowField& flow, ImageSize size) {
  return flow.size == size && flow.x_px.size() == size.pixel_count() &&
         flow.y_px.size() == size.pixel_count();
}

/// Runs `work`; its errors name the recording.
template <class Work>
void naming(const std::filesystem::path& target, Work work) {
  try {
    work();
  } catch (const std::runtime_error&) {
    std::throw_with_nested(std::runtime_error("cannot write the recording " + target.string()));
  }
}

}  // namespace

struct MvsecWriter::File {
  Hdf5OutputFile hdf5;
  ImageSize size;
  std::optional<GrowingDataset<double>> events;
  std::optional<GrowingDataset<std::uint8_t>> frames;
  std::optional<GrowingDataset<float>> flow;
  bool committed = false;
  bool has_flow = false;
  std::int64_t event_count = 0;
  double last_event_s = kBeforeAll;
  std::vector<double> times_s;
  std::vector<std::int64_t> event_index;

  File(const std::filesystem::path& target, ImageSize frame_size)
      : hdf5(target), size(frame_size) {}

  template <class Work>
  void write(Work work);

  void create_objects(const std::string& settings);
  void append_flow(const FlowField& field);
  void close();

  Dims image() const {
    return {static_cast<hsize_t>(size.height), static_cast<hsize_t>(size.width)};
  }
  double last_frame_s() const { return times_s.empty() ? kBeforeAll : times_s.back(); }
  std::vector<double> rows_of(std::span<const Event> events_to_add) const;
  void check_frame(const GreyImage& frame, double time_s, const FlowField* flow_to_frame) const;
};

/// Runs HDF5 calls.
template <class Work>
void MvsecWriter::File::write(Work work) {
  if (committed) {
    throw std::logic_error("expected no more calls after commit: " + hdf5.target().string());
  }
  naming(hdf5.target(), [&] { hdf5.write(work); });
}

void MvsecWriter::File::create_objects(const std::string& settings) {
  write_attribute(hdf5.id(), "simulation", settings);
  for (const std::string& path : {std::string("davis"), std::string("davis/") + kCamera}) {
    create_group(hdf5.id(), path).close(path);
  }
  const Hdf5Layout layout = mvsec_layout(kCamera);
  // Events are chunked by column, since x, y, t and p compress best each among its like.
  events.emplace(hdf5.id(), layout.events, Dims{4}, Dims{kEventsPerChunk, 1}, kEventsPerChunk);
  const Dims sides = image();
  frames.emplace(hdf5.id(), layout.frames, sides, Dims{1, sides[0], sides[1]}, 1);
}

void MvsecWriter::File::append_flow(const FlowField& field) {
  if (!flow) {
    const Dims sides = image();
    flow.emplace(hdf5.id(), mvsec_layout(kCamera).flow, Dims{2, sides[0], sides[1]},
                 Dims{1, 1, sides[0], sides[1]}, 1);
  }
  flow->append(field.x_px);
  flow->append(field.y_px);
}

/// Writes the frames' times and event indices, and closes everything.
void MvsecWriter::File::close() {
  const Hdf5Layout layout = mvsec_layout(kCamera);
  events->close();
  frames->close();
  if (flow) flow->close();
  write_dataset(hdf5.id(), layout.frame_times, times_s, {times_s.size()}, kRecordingDeflateLevel);
  write_dataset(hdf5.id(), layout.event_index, event_index, {event_index.size()},
                kRecordingDeflateLevel);
  hdf5.close();
}

/// [events, 4], after checking the events.
std::vector<double> MvsecWriter::File::rows_of(std::span<const Event> events_to_add) const {
  std::vector<double> rows;
  rows.reserve(4 * events_to_add.size());
  EventCheck check(size, last_frame_s(), kAfterAll);
  double last_s = last_event_s;
  for (const Event& event : events_to_add) {
    const StoredEvent row{static_cast<double>(event.x), static_cast<double>(event.y), event.t_s,
                          event.positive ? 1.0 : -1.0};
    try {
      check.take(row);
    } catch (const EventFault& fault) {
      throw std::invalid_argument(fault.what());
    }
    require(event.t_s >= last_s, "expected events in time order, over all calls");
    last_s = event.t_s;
    rows.insert(rows.end(), {row.x, row.y, row.t_s, row.polarity});
  }
  return rows;
}

void MvsecWriter::File::check_frame(const GreyImage& frame, double time_s,
                                    const FlowField* flow_to_frame) const {
  require(frame.size == size && frame.pixels.size() == size.pixel_count(),
          "expected frames of the recording's size");
  require(std::isfinite(time_s) && time_s > last_frame_s() && time_s >= last_event_s,
          "expected a frame after the one before and not before any event");
  if (times_s.empty()) {
    return require(flow_to_frame == nullptr, "expected no flow to the first frame");
  }
  if (times_s.size() > 1) {
    require(has_flow == (flow_to_frame != nullptr),
            "expected a flow to every frame but the first, or none");
  }
  require(flow_to_frame == nullptr || is_field(*flow_to_frame, size),
          "expected a flow of the recording's size");
}

MvsecWriter::MvsecWriter(const std::filesystem::path& file, ImageSize size,
                         const std::string& settings) {
  require(size.height > 0 && size.width > 0, "expected an image size of at least 1x1");
  naming(file, [&] { file_ = std::make_unique<File>(file, size); });
  file_->write([&] { file_->create_objects(settings); });
}

MvsecWriter::~MvsecWriter() = default;

void MvsecWriter::add_events(std::span<const Event> events) {
  if (events.empty()) return;
  const std::vector<double> rows = file_->rows_of(events);
  file_->write([&] { file_->events->append(rows); });
  file_->event_count += static_cast<std::int64_t>(events.size());
  file_->last_event_s = events.back().t_s;
}

void MvsecWriter::add_frame(const GreyImage& frame, double time_s,
                            const FlowField* flow_from_previous) {
  file_->check_frame(frame, time_s, flow_from_previous);
  file_->write([&] {
    file_->frames->append(frame.pixels);
    if (flow_from_previous != nullptr) file_->append_flow(*flow_from_previous);
  });
  file_->has_flow = flow_from_previous != nullptr;
  file_->times_s.push_back(time_s);
  file_->event_index.push_back(file_->event_count - 1);
}

void MvsecWriter::commit(const std::function<void()>& before_publishing) {
  const std::filesystem::path& target = file_->hdf5.target();
  if (file_->times_s.empty()) {
    throw std::logic_error("expected at least one frame, got none, in " + target.string());
  }
  file_->write([&] { file_->close(); });
  naming(target, [&] { file_->hdf5.output().sync(); });
  if (before_publishing) before_publishing();
  naming(target, [&] { file_->hdf5.output().publish(); });
  file_->committed = true;
}

}  // namespace eventgan

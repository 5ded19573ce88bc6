#include "stages/recordings/mvsec_writer.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "stages/files/atomic_file.h"
#include "stages/recordings/event_check_internal.h"
#include "stages/recordings/hdf5_turn_internal.h"
#include "stages/recordings/mvsec_file_internal.h"

namespace eventgan {
namespace {

constexpr double kBeforeAll = -std::numeric_limits<double>::infinity();
constexpr double kAfterAll = std::numeric_limits<double>::max();

void require(bool condition, const std::string& rule) {
  if (!condition) throw std::invalid_argument(rule);
}

bool is_field(const FlowField& flow, ImageSize size) {
  return flow.size == size && flow.x_px.size() == size.pixel_count() &&
         flow.y_px.size() == size.pixel_count();
}

}  // namespace

struct MvsecWriter::File {
  AtomicFile output;  ///< before its HDF5, which is closed first
  ImageSize size;
  std::optional<MvsecFile> hdf5;
  bool committed = false;
  bool has_flow = false;
  std::int64_t event_count = 0;
  double last_event_s = kBeforeAll;
  std::vector<double> times_s;
  std::vector<std::int64_t> event_index;

  File(const std::filesystem::path& target, ImageSize frame_size)
      : output(target), size(frame_size) {}
  ~File();

  /// Runs HDF5 calls in this thread's turn; errors name the file.
  template <class Work>
  void write(Work work);

  double last_frame_s() const { return times_s.empty() ? kBeforeAll : times_s.back(); }
  std::vector<double> rows_of(std::span<const Event> events) const;
  void check_frame(const GreyImage& frame, double time_s, const FlowField* flow) const;
};

MvsecWriter::File::~File() {
  const Hdf5Turn turn;
  hdf5.reset();
}

template <class Work>
void MvsecWriter::File::write(Work work) {
  if (committed)
    throw std::logic_error("expected no more calls after commit: " + output.target().string());
  const Hdf5Turn turn;
  try {
    try {
      work();
    } catch (const Hdf5Error&) {
      if (hdf5) hdf5->check();  // a full disk explains more than what HDF5 made of it
      throw;
    }
    hdf5->check();
  } catch (const std::runtime_error&) {
    std::throw_with_nested(
        std::runtime_error("cannot write the recording " + output.target().string()));
  }
}

/// [events, 4], after checking the events.
std::vector<double> MvsecWriter::File::rows_of(std::span<const Event> events) const {
  std::vector<double> rows;
  rows.reserve(4 * events.size());
  EventCheck check(size, last_frame_s(), kAfterAll);
  double last_s = last_event_s;
  for (const Event& event : events) {
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
                                    const FlowField* flow) const {
  require(frame.size == size && frame.pixels.size() == size.pixel_count(),
          "expected frames of the recording's size");
  require(std::isfinite(time_s) && time_s > last_frame_s() && time_s >= last_event_s,
          "expected a frame after the one before and not before any event");
  if (times_s.empty()) return require(flow == nullptr, "expected no flow to the first frame");
  if (times_s.size() > 1) {
    require(has_flow == (flow != nullptr), "expected a flow to every frame but the first, or none");
  }
  require(flow == nullptr || is_field(*flow, size), "expected a flow of the recording's size");
}

MvsecWriter::MvsecWriter(const std::filesystem::path& file, ImageSize size,
                         const std::string& settings)
    : file_(std::make_unique<File>(file, size)) {
  require(size.height > 0 && size.width > 0, "expected a picture size of at least 1x1");
  file_->write([&] { file_->hdf5.emplace(file_->output.temporary(), size, settings); });
}

MvsecWriter::~MvsecWriter() = default;

void MvsecWriter::add_events(std::span<const Event> events) {
  if (events.empty()) return;
  const std::vector<double> rows = file_->rows_of(events);
  file_->write([&] { file_->hdf5->append_events(rows); });
  file_->event_count += static_cast<std::int64_t>(events.size());
  file_->last_event_s = events.back().t_s;
}

void MvsecWriter::add_frame(const GreyImage& frame, double time_s,
                            const FlowField* flow_from_previous) {
  file_->check_frame(frame, time_s, flow_from_previous);
  file_->write([&] {
    file_->hdf5->append_frame(frame.pixels);
    if (flow_from_previous == nullptr) return;
    file_->hdf5->append_flow(flow_from_previous->x_px, flow_from_previous->y_px);
  });
  file_->has_flow = flow_from_previous != nullptr;
  file_->times_s.push_back(time_s);
  file_->event_index.push_back(file_->event_count - 1);
}

void MvsecWriter::commit() {
  if (file_->times_s.empty()) {
    throw std::logic_error("expected at least one frame, got none, in " +
                           file_->output.target().string());
  }
  file_->write([&] { file_->hdf5->close(file_->times_s, file_->event_index); });
  try {
    file_->output.publish();
  } catch (const std::runtime_error&) {
    std::throw_with_nested(
        std::runtime_error("cannot write the recording " + file_->output.target().string()));
  }
  file_->committed = true;
}

}  // namespace eventgan

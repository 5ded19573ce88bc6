#include "stages/recordings/readers/detail/event_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/readers/detail/frame_intervals.h"
#include "stages/recordings/readers/detail/hdf5_table.h"
#include "stages/recordings/readers/detail/image_frames.h"
#include "stages/recordings/readers/detail/open_files.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr double kTicksPerSecond = 1e6;
constexpr std::int64_t kTicksPerMs = 1000;
constexpr std::int64_t kLatest_us = std::int64_t{1} << 53;  // a double has each of them exactly

Hdf5Table open_numbers(hid_t file, const std::string& path, const std::string& name,
                       bool is_float = false) {
  Hdf5Table table(file, path, name);
  if (table.is_float() != is_float || table.dims().size() != 1) {
    table.refuse(is_float ? "float numbers [N]" : "whole numbers [N]");
  }
  return table;
}

/// All numbers of a small dataset of any shape, at most `most` of them.
std::vector<std::int64_t> read_few(hid_t file, const std::string& path, const std::string& name,
                                   std::size_t most) {
  const Hdf5Table table(file, path, name);
  if (table.is_float() || element_count(table.dims()) > most) {
    table.refuse(fmt::format("{} whole number{}", most, most > 1 ? "s" : ""));
  }
  return read_elements<std::int64_t>(open_object(file, path), path, element_type<std::int64_t>());
}

/// The columns in an open file, of which it is known that they are as long as each other.
struct Columns {
  Columns(const fs::path& path, const ColumnLayout& layout)
      : file(open_recording_file(path)),
        x(open_numbers(file, layout.column("x"), path.string())),
        y(open_numbers(file, layout.column("y"), path.string())),
        t(open_numbers(file, layout.column("t"), path.string(), layout.counts_seconds)),
        p(open_numbers(file, layout.column("p"), path.string())) {
    for (const Hdf5Table* column : {&x, &y, &p}) {
      if (column->dims() == t.dims()) continue;
      column->refuse("as many numbers as " + layout.column("t") + ", " +
                     std::to_string(t.dims()[0]));
    }
  }

  Hdf5Handle file;  ///< before what is in it, so that it closes last
  Hdf5Table x, y, t, p;
};

class ColumnStore final : public EventStore {
 public:
  ColumnStore(const fs::path& path, const ColumnLayout& layout)
      : name_(path.string()),
        counts_seconds_(layout.counts_seconds),
        columns_([this, path, layout] {
          Columns columns(path, layout);
          const auto events = static_cast<std::int64_t>(columns.t.dims()[0]);
          if (count_ < 0) count_ = events;
          if (events == count_) return columns;
          throw InputError(
              fmt::format("expected {} events as before, got {}, in {}", count_, events, name_));
        }) {
    const auto columns = columns_.get();
    const hid_t file = columns->file;
    if (!layout.t_offset.empty() && has_object(file, layout.t_offset)) {
      const std::vector<std::int64_t> offset = read_few(file, layout.t_offset, name_, 1);
      if (offset.size() != 1 || offset[0] <= -kLatest_us || offset[0] >= kLatest_us) {
        throw InputError(fmt::format("expected an offset of fewer than 2^53 us, got {}, in {} ({})",
                                     fmt::join(offset, ", "), name_, layout.t_offset));
      }
      offset_us_ = offset[0];
    }
  }

  /// What the index of milliseconds has of other events than these; empty if it fits, or there is
  /// none. Nothing is looked up in it.
  std::string index_fault(const std::string& index) const try {
    const Hdf5Lock lock;
    const auto columns = columns_.get();
    if (!index.empty() && has_object(columns->file, index)) {
      check_index(columns->t, open_numbers(columns->file, index, name_));
    }
    return "";
  } catch (const InputError& error) {
    return error.what();
  }

  /// The largest x and y of all events, or of a million that lie all over a larger file; -1 where
  /// none is there or can be read.
  std::array<std::int64_t, 2> reach() const {
    constexpr std::int64_t kBlock = std::int64_t{1} << 16;
    std::array<std::int64_t, 2> most{-1, -1};
    const std::int64_t length = std::min(kBlock, count_);
    const std::int64_t blocks = std::min<std::int64_t>((count_ + kBlock - 1) / kBlock, 16);
    const Hdf5Lock lock;
    const auto columns = columns_.get();
    for (std::int64_t block = 0; block < blocks; ++block) {
      const std::int64_t first = block * (count_ - length) / std::max<std::int64_t>(blocks - 1, 1);
      try {
        most[0] = std::max(most[0], std::ranges::max(numbers(columns->x, first, length)));
        most[1] = std::max(most[1], std::ranges::max(numbers(columns->y, first, length)));
      } catch (const InputError&) {  // the fault of its windows
      }
    }
    return most;
  }

  std::int64_t count() const override { return count_; }

  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const override {
    const Hdf5Lock lock;
    const auto columns = columns_.get();
    const auto x = numbers(columns->x, first, count), y = numbers(columns->y, first, count),
               p = numbers(columns->p, first, count);
    const std::vector<double> t = times_s(first, count);
    std::vector<StoredEvent> events(t.size());
    for (std::size_t i = 0; i < t.size(); ++i) {
      events[i] = {static_cast<double>(x[i]), static_cast<double>(y[i]), t[i],
                   static_cast<double>(p[i])};
    }
    return events;
  }

  std::vector<double> times_s(std::int64_t first, std::int64_t count) const override {
    if (counts_seconds_) {
      const Hdf5Lock lock;
      return numbers<double>(columns_.get()->t, first, count);
    }
    const std::vector<std::int64_t> ticks = [&] {
      const Hdf5Lock lock;
      return numbers(columns_.get()->t, first, count);
    }();
    std::vector<double> times(ticks.size());
    for (std::size_t i = 0; i < ticks.size(); ++i) {
      if (ticks[i] <= -kLatest_us || ticks[i] >= kLatest_us) {
        throw InputError(
            fmt::format("expected a time of fewer than 2^53 us, got {}, in {} (event {})", ticks[i],
                        name_, first + static_cast<std::int64_t>(i)));
      }
      times[i] = static_cast<double>(ticks[i] + offset_us_) / kTicksPerSecond;
    }
    return times;
  }

 private:
  template <class Number = std::int64_t>
  static std::vector<Number> numbers(const Hdf5Table& table, std::int64_t first,
                                     std::int64_t count) {
    std::vector<Number> values(static_cast<std::size_t>(count));
    if (count == 0) return values;
    read_hdf5(fmt::format("{} (entries {}..{})", table.place(), first, first + count - 1),
              [&] { table.read({static_cast<hsize_t>(first)}, {values.size()}, values.data()); });
    return values;
  }

  /// Throws InputError where one of some entries leads to another event.
  void check_index(const Hdf5Table& t, const Hdf5Table& index) const {
    const auto entries = static_cast<std::int64_t>(index.dims()[0]);
    const std::int64_t checks = std::min<std::int64_t>(entries, 16);
    for (std::int64_t check = 0; check < checks; ++check) {
      const std::int64_t ms = check * (entries - 1) / std::max<std::int64_t>(checks - 1, 1);
      const std::int64_t event = numbers(index, ms, 1)[0];
      const bool is_event = event >= 0 && event <= count();
      const bool is_after =
          is_event && (event == count() || numbers(t, event, 1)[0] >= ms * kTicksPerMs);
      const bool is_first =
          is_event && (event == 0 || numbers(t, event - 1, 1)[0] < ms * kTicksPerMs);
      if (is_after && is_first) continue;
      throw InputError(fmt::format(
          "expected the first of {} events at or after {} ms, got event {}, in {} (entry {})",
          count(), ms, event, index.place(), ms));
    }
  }

  std::string name_;
  bool counts_seconds_;
  std::int64_t count_ = -1;  ///< -1: not opened yet
  OpenedAtUse<Columns> columns_;
  std::int64_t offset_us_ = 0;
};

/// What datasets say of the sensor; none if there are none.
std::optional<ImageSize> dataset_size(hid_t file, const ColumnLayout& layout,
                                      const std::string& name) {
  std::vector<std::int64_t> sides;  // height, width
  for (const std::string& path : layout.size) {
    if (!has_object(file, path)) return std::nullopt;
    const std::vector<std::int64_t> found = read_few(file, path, name, 2 / layout.size.size());
    sides.insert(sides.end(), found.begin(), found.end());
  }
  if (sides.size() != 2) return std::nullopt;
  if (layout.size.size() == 1) std::swap(sides[0], sides[1]);
  constexpr std::int64_t kMostPixels = kMaxImagePixels;
  if (sides[0] < 1 || sides[1] < 1 || sides[0] > kMostPixels / sides[1]) {
    throw InputError(fmt::format("expected a sensor of 1 to {} pixels, got {}x{}, in {} ({})",
                                 kMostPixels, sides[1], sides[0], name, layout.size[0]));
  }
  return ImageSize{static_cast<int>(sides[0]), static_cast<int>(sides[1])};
}

/// DSEC's own files do not tell their size, and other cameras' have their layout: taken by what the
/// events reach, with a note; none where that may be several sizes.
std::optional<ImageSize> assumed_size(const ColumnStore& events, StoredParts& parts) {
  constexpr ImageSize kDsec{480, 640}, kDavis{260, 346};
  // DAGr halves DSEC's; M3ED's are copied into its layout.
  constexpr std::array kOthers{ImageSize{240, 320}, kDavis, ImageSize{720, 1280}};
  const auto [x, y] = events.reach();
  const bool is_larger = x >= kDavis.width || y >= kDavis.height;
  std::optional<ImageSize> size;
  if (x < kDsec.width && y < kDsec.height && (is_larger || x < 0)) size = kDsec;
  for (const ImageSize other : kOthers) {
    if (x + 1 == other.width && y + 1 == other.height) size = other;
  }
  if (!size) return std::nullopt;
  parts.notes.push_back(fmt::format(
      "the file has no size of the sensor: {} is assumed, since its events reach x = {}, y = {} "
      "(else set \"sensor\" or --sensor), in {}",
      to_string(*size), x, y, parts.name));
  return size;
}

/// timestamps.txt: a line with µs for each frame.
std::vector<double> read_timestamps(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text) {
    throw InputError("expected the frames' times, got no readable file (" + reason + "), in " +
                     file.string());
  }
  std::vector<double> times_s;
  std::istringstream stream(*text);
  for (std::string line; std::getline(stream, line);) {
    std::int64_t time_us = 0;
    const char* const end = line.data() + line.find_last_not_of(" \r") + 1;
    const auto [stop, error] = std::from_chars(line.data(), end, time_us);
    if (error != std::errc() || stop != end || time_us <= -kLatest_us || time_us >= kLatest_us) {
      throw InputError(fmt::format("expected a time in whole us, got another line, in {} (line {})",
                                   file.string(), times_s.size() + 1));
    }
    times_s.push_back(static_cast<double>(time_us) / kTicksPerSecond);
  }
  check_frame_times(times_s, file.string());
  return times_s;
}

std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

/// SEQUENCE/events/left/events.h5, where `path` is SEQUENCE; else `path`.
fs::path dsec_event_file(const fs::path& path, const RecordingOptions& options) {
  fs::path file = path / "events" / options.camera / "events.h5";
  std::error_code ignored;
  return fs::is_regular_file(file, ignored) ? file : path;
}

/// The folder of a sequence, of its events/left/events.h5; empty for a file that lies elsewhere.
fs::path sequence_of(const fs::path& events_file) {
  const fs::path side = events_file.parent_path();
  return side.parent_path().filename() == "events" ? side.parent_path().parent_path() : fs::path();
}

/// What of a sequence may be read beside its events.h5: timestamps.txt of the frames, if it is
/// there, and rectify_map.h5, if the options ask for it.
std::vector<fs::path> dsec_companions(const fs::path& events_file,
                                      const RecordingOptions& options) {
  std::vector<fs::path> files;
  if (options.rectify) files.push_back(events_file.parent_path() / "rectify_map.h5");
  const fs::path times = sequence_of(events_file) / "images" / "timestamps.txt";
  std::error_code ignored;
  if (!sequence_of(events_file).empty() && fs::is_regular_file(times, ignored)) {
    files.push_back(times);
  }
  return files;
}

/// Images of the events' own view and size; where there are others, a note says why not.
std::vector<fs::path> find_frames(const fs::path& sequence, ImageSize size,
                                  const RecordingOptions& options,
                                  std::vector<std::string>& notes) {
  if (sequence.empty()) return {};
  const fs::path side = sequence / "images" / options.camera;
  const fs::path own = side / (options.rectify ? "rectified" : "distorted");
  const fs::path other = side / (options.rectify ? "distorted" : "rectified");
  std::vector<fs::path> files = images_in(own);
  if (!files.empty()) {
    ImageSize found;
    try {
      found = image_file_size(files[0]);
    } catch (const std::runtime_error& error) {
      std::throw_with_nested(InputError(std::string(error.what()) + ", in " + files[0].string()));
    }
    if (found == size) return files;
    notes.push_back("opened without frames, which are another camera's: expected images of " +
                    to_string(size) + " as the events', got " + to_string(found) + ", in " +
                    own.string());
  } else if (!images_in(other).empty()) {
    notes.push_back("opened without frames, which are not of the events' view, in " +
                    other.string());
  }
  return {};
}

/// Where each pixel's events move to; -1 if they leave the image.
std::vector<std::int32_t> read_rectify_map(const fs::path& path, ImageSize size) {
  const Hdf5Lock lock;
  const Hdf5Handle file = open_recording_file(path);
  const Hdf5Table table(file, "rectify_map", path.string());
  const auto height = static_cast<hsize_t>(size.height);
  const auto width = static_cast<hsize_t>(size.width);
  if (!table.is_float() || table.dims() != Dims{height, width, 2}) {
    table.refuse(fmt::format("float [{}, {}, 2], the sensor's size", height, width));
  }
  std::vector<float> places(2 * size.pixel_count());
  read_hdf5(table.place(), [&] { table.read({0, 0, 0}, {height, width, 2}, places.data()); });
  std::vector<std::int32_t> target(size.pixel_count(), -1);
  for (std::size_t i = 0; i < target.size(); ++i) {
    const double x = std::floor(places[2 * i] + 0.5), y = std::floor(places[2 * i + 1] + 0.5);
    if (!std::isfinite(x) || !std::isfinite(y)) {
      throw InputError(fmt::format("expected finite places, got others, in {} (x = {}, y = {})",
                                   table.place(), i % width, i / width));
    }
    if (x >= 0 && y >= 0 && x < size.width && y < size.height) {
      target[i] = static_cast<std::int32_t>(y * size.width + x);
    }
  }
  return target;
}

}  // namespace

bool moves_events(const fs::path& rectify_map, ImageSize sensor) {
  const std::vector<std::int32_t> target = read_rectify_map(rectify_map, sensor);
  for (std::size_t i = 0; i < target.size(); ++i) {
    if (target[i] != static_cast<std::int32_t>(i)) return true;
  }
  return false;
}

StoredParts open_event_columns(const fs::path& path, const ColumnLayout& layout,
                               const RecordingOptions& options) {
  const Hdf5Lock lock;
  StoredParts parts;
  parts.name = path.string();
  parts.index_key = hdf5_index_key(path, layout.column("t"));
  std::optional<ImageSize> told;
  bool is_dsec = false;
  try {
    read_hdf5(parts.name, [&] {
      const Hdf5Handle file = open_recording_file(path);
      is_dsec = !layout.t_offset.empty() && has_object(file, layout.t_offset) &&
                has_object(file, layout.ms_index);
      told = dataset_size(file, layout, parts.name);
      if (!told && has_object(file, layout.events)) {
        told = attribute_size(file, layout.events, parts.name);
      }
    });
  } catch (const InputError& error) {
    if (!options.sensor) throw;
    parts.warnings.push_back(std::string("the file's size of the sensor is not used: ") +
                             error.what());
  }
  auto events = read_hdf5(parts.name, [&] { return std::make_unique<ColumnStore>(path, layout); });
  if (!told && !options.sensor && is_dsec) told = assumed_size(*events, parts);
  parts.size = sensor_size(told, options.sensor, parts);
  if (const std::string fault = events->index_fault(layout.ms_index); !fault.empty()) {
    parts.notes.push_back(layout.ms_index + " does not fit the events and is not used: " + fault);
  }
  parts.events = std::move(events);
  return parts;
}

std::unique_ptr<Recording> open_dsec_recording(const fs::path& path,
                                               const RecordingOptions& options) {
  const fs::path file = dsec_event_file(path, options);
  StoredParts parts = open_event_columns(file, dsec_layout(), options);
  const fs::path sequence = sequence_of(fs::absolute(file).lexically_normal());
  std::vector<fs::path> frames = find_frames(sequence, parts.size, options, parts.notes);
  if (!frames.empty()) {
    const fs::path times = sequence / "images" / "timestamps.txt";
    std::vector<double> times_s = read_timestamps(times);
    if (times_s.size() != frames.size()) {
      throw InputError(fmt::format("expected a time for each of {} images, got {}, in {}",
                                   frames.size(), times_s.size(), times.string()));
    }
    parts.frames = std::make_unique<ImageFrames>(std::move(frames), std::move(times_s));
  }
  if (options.rectify) {
    std::vector<std::int32_t> target =
        read_rectify_map(file.parent_path() / "rectify_map.h5", parts.size);
    if (const auto outside = std::ranges::count(target, -1)) {
      parts.notes.push_back(fmt::format(
          "rectified: events of {} of {} pixels leave the image and are left out, in {}", outside,
          target.size(), parts.name));
    }
    parts.move = [target = std::move(target), width = parts.size.width](Event& event) {
      const std::int32_t to =
          target[static_cast<std::size_t>(event.y) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(event.x)];
      event.x = to % width;
      event.y = to / width;
      return to >= 0;
    };
  }
  return make_stored_recording(std::move(parts));
}

std::unique_ptr<Recording> open_m3ed_recording(const fs::path& path,
                                               const RecordingOptions& options) {
  StoredParts parts = open_event_columns(path, m3ed_layout(options.camera), options);
  const Hdf5Lock lock;
  if (has_object(open_recording_file(path), "ovc")) {
    parts.notes.push_back("opened without frames, which are another camera's (ovc), in " +
                          parts.name);
  }
  return make_stored_recording(std::move(parts));
}

constinit const RecordingReader kDsecReader{
    .format = RecordingFormat::kDsec,
    .fits =
        [](const RecordingInput& input, const RecordingOptions& options) {
          return input.is_folder() ? dsec_event_file(input.path(), options) != input.path()
                                   : input.has_hdf5_object(dsec_layout().events + "/t");
        },
    .open = open_dsec_recording,
    .event_file = dsec_event_file,
    .companions = dsec_companions};

constinit const RecordingReader kM3edReader{
    .format = RecordingFormat::kM3ed,
    .fits =
        [](const RecordingInput& input, const RecordingOptions& options) {
          return input.has_hdf5_object(m3ed_layout(options.camera).events + "/t");
        },
    .open = open_m3ed_recording};

}  // namespace eventgan

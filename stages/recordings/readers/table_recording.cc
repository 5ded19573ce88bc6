#include "stages/recordings/readers/detail/table_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/numpy_layout.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "stages/recordings/readers/detail/recording_reader.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// As StoredEvent has them but for the time, which is first.
enum Column : std::size_t { kTime, kX, kY, kPolarity, kColumns };

std::array<std::string, kColumns> names_of(const EventFields& columns) {
  return {columns.t, columns.x, columns.y, columns.p};
}

/// A row's numbers, in the columns' order.
using Row = std::array<double, kColumns>;

/// Events with their times as the table has them, and how large its sensor is if it says.
struct TableContent {
  CompactEvents events;
  std::optional<ImageSize> sensor;
};

StoredEvent event_of(const Row& row) { return {row[kX], row[kY], row[kTime], row[kPolarity]}; }

// ---- NumPy

/// Columns of an array [N, 4] by the names that the options give them.
std::array<std::size_t, kColumns> places_of(const EventFields& columns, const std::string& name) {
  const std::array<std::string, kColumns> defaults = names_of(EventFields());
  const std::array<std::string, kColumns> names = names_of(columns);
  std::array<std::size_t, kColumns> places{};
  for (std::size_t i = 0; i < kColumns; ++i) {
    const bool is_number = names[i].size() == 1 && names[i][0] >= '0' && names[i][0] <= '3';
    if (!is_number && names[i] != defaults[i]) {
      throw InputError(
          "expected fields by names, got an array [N, 4] (\"columns\" may have the "
          "numbers 0 to 3), in " +
          name);
    }
    places[i] = is_number ? static_cast<std::size_t>(names[i][0] - '0') : i;
    if (std::find(places.begin(), places.begin() + i, places[i]) != places.begin() + i) {
      throw InputError("expected each of the columns 0 to 3 once, got " + names[i] + " twice, in " +
                       name);
    }
  }
  return places;
}

CompactEvents from_columns(const std::array<TypedArray, kColumns>& arrays,
                           const EventFields& columns, const std::string& file) {
  const std::array<std::string, kColumns> names = names_of(columns);
  const std::size_t count = arrays[kTime].size();
  for (std::size_t i = 0; i < kColumns; ++i) {
    const TypedArray& array = arrays[i];
    if (array.shape.size() != 1 || array.is_text() || array.size() != count) {
      throw InputError("expected numbers [" + std::to_string(count) + "], got " +
                       (array.is_text() ? "text " : "") + array.shape_text() + ", in " + file +
                       " (" + names[i] + ")");
    }
  }
  CompactEvents events;
  events.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    Row row{};
    for (std::size_t i = 0; i < kColumns; ++i) row[i] = arrays[i].number(k);
    events.push_back(event_of(row));
  }
  return events;
}

CompactEvents read_npy(const fs::path& path, const EventFields& columns) {
  const std::string name = path.string();
  const InputFile file(path);
  const std::vector<std::byte> bytes = file.read_bytes(0, file.size_bytes());
  std::size_t begin = 0;
  if (parse_npy_header(bytes, name, begin).fields.empty()) {
    const std::array<std::size_t, kColumns> places = places_of(columns, name);
    const TypedArray array = parse_npy(bytes, name);
    if (array.shape.size() != 2 || array.shape[1] != kColumns || array.is_text()) {
      throw InputError("expected numbers [N, 4], got " + array.shape_text() + ", in " + name);
    }
    CompactEvents events;
    events.reserve(array.shape[0]);
    for (std::size_t k = 0; k < array.shape[0]; ++k) {
      Row row{};
      for (std::size_t i = 0; i < kColumns; ++i) row[i] = array.number(k * kColumns + places[i]);
      events.push_back(event_of(row));
    }
    return events;
  }
  std::vector<NamedArray> fields = parse_npy_fields(bytes, name);
  std::array<TypedArray, kColumns> arrays;
  const std::array<std::string, kColumns> names = names_of(columns);
  for (std::size_t i = 0; i < kColumns; ++i) {
    const auto field = std::ranges::find(fields, names[i], &NamedArray::name);
    if (field == fields.end()) {
      throw InputError("expected a field \"" + names[i] + "\", got none, in " + name);
    }
    arrays[i] = field->values;  // a name may be there for two
  }
  return from_columns(arrays, columns, name);
}

CompactEvents read_npz(const fs::path& path, const EventFields& columns) {
  const ZipArchive archive(path);
  std::array<TypedArray, kColumns> arrays;
  const std::array<std::string, kColumns> names = names_of(columns);
  for (std::size_t i = 0; i < kColumns; ++i) {
    const std::string member = names[i] + ".npy";
    if (!archive.contains(member)) {
      throw InputError("expected an array \"" + names[i] + "\", got none, in " + path.string());
    }
    arrays[i] = parse_npy(archive.read(member), path.string() + " (" + names[i] + ")");
  }
  return from_columns(arrays, columns, path.string());
}

// ---- CSV

/// The columns' places in a header line; none unless it has all of them.
std::optional<std::array<std::size_t, kColumns>> find_columns(const CsvRecord& header,
                                                              const EventFields& columns) {
  std::array<std::size_t, kColumns> places{};
  const std::array<std::string, kColumns> names = names_of(columns);
  for (std::size_t i = 0; i < kColumns; ++i) {
    if (std::ranges::count(header.fields, names[i]) != 1) return std::nullopt;
    places[i] = static_cast<std::size_t>(std::ranges::find(header.fields, names[i]) -
                                         header.fields.begin());
  }
  return places;
}

/// A line of Metavision's CSV, which has no header: x, y, p and t in µs, whole numbers.
bool is_metavision_line(const CsvRecord& record) {
  const auto is_whole = [](std::string_view field) {
    std::int64_t number = 0;
    const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), number);
    return error == std::errc() && stop == field.data() + field.size();
  };
  return record.fields.size() == kColumns && std::ranges::all_of(record.fields, is_whole);
}

/// Lines before the first with fields, "%geometry:1280,720"; they go off `text`. Gives the size.
std::optional<ImageSize> take_metavision_header(std::string_view& text) {
  std::optional<ImageSize> sensor;
  while (text.starts_with('%')) {
    const std::string_view line = text.substr(0, text.find('\n'));
    constexpr std::string_view kGeometry = "%geometry:";
    if (line.starts_with(kGeometry)) {
      ImageSize size;
      const char* const end = line.data() + line.size();
      const auto width = std::from_chars(line.data() + kGeometry.size(), end, size.width);
      const bool goes_on = width.ec == std::errc() && width.ptr != end && *width.ptr == ',';
      if (goes_on && std::from_chars(width.ptr + 1, end, size.height).ec == std::errc() &&
          std::min(size.width, size.height) >= 1 &&
          std::max(size.width, size.height) <= kMostSensorSide) {
        sensor = size;
      }
    }
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return sensor;
}

/// Which fields of a CSV are what, by its first line: a header, or an event of Metavision's.
struct CsvLayout {
  std::array<std::size_t, kColumns> places{};
  std::size_t fields = 0;
  bool has_header = true;
};

std::optional<CsvLayout> layout_of(const CsvRecord& first, const EventFields& columns) {
  if (const auto places = find_columns(first, columns))
    return CsvLayout{*places, first.fields.size()};
  const bool is_named = names_of(columns) != names_of(EventFields());
  if (is_named || !is_metavision_line(first)) return std::nullopt;
  return CsvLayout{{3, 0, 1, 2}, kColumns, false};
}

TableContent read_csv(const fs::path& path, const EventFields& columns) {
  const std::string text = read_text_file(path);
  const std::array<std::string, kColumns> names = names_of(columns);
  std::string_view rest = text;
  TableContent content{{}, take_metavision_header(rest)};
  const auto lines_before = static_cast<int>(std::count(text.data(), rest.data(), '\n'));
  const auto refuse = [&](const std::string& fault, int line) {
    throw InputError(fault + ", in " + path.string() + " (line " +
                     std::to_string(lines_before + line) + ")");
  };
  CsvReader reader(rest);
  std::optional<CsvRecord> record = reader.next();
  if (!record && content.sensor) return content;  // Metavision's, without events
  if (!record) refuse("expected a header line, got none", 1);
  const auto layout = layout_of(*record, columns);
  if (!layout) {
    refuse("expected a header line with " + columns.t + ", " + columns.x + ", " + columns.y +
               " and " + columns.p + " (\"columns\" in the manifest names others), got another",
           record->line);
  }
  content.events.reserve(static_cast<std::size_t>(std::ranges::count(rest, '\n')) + 1);
  if (layout->has_header) record = reader.next();
  for (; record; record = reader.next()) {
    if (record->fields.empty()) refuse(record->fault, record->line);
    if (record->fields.size() != layout->fields) {
      refuse("expected " + std::to_string(layout->fields) + " fields, got " +
                 std::to_string(record->fields.size()),
             record->line);
    }
    Row row{};
    for (std::size_t i = 0; i < kColumns; ++i) {
      const std::string_view field = record->fields[layout->places[i]];
      const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), row[i]);
      if (error != std::errc() || stop != field.data() + field.size()) {
        refuse("expected a number of " + names[i] + ", got another field", record->line);
      }
    }
    content.events.push_back(event_of(row));
  }
  return content;
}

TableContent read_table(const fs::path& path, const EventFields& columns) try {
  if (path.extension() == ".npy") return {read_npy(path, columns), {}};
  if (path.extension() == ".npz") return {read_npz(path, columns), {}};
  return read_csv(path, columns);
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

/// What times count, and what tells so.
struct TimeUnit {
  double ticks_per_s = 1e6;
  std::string_view reason;  ///< empty: it is told, or there is no time
};

/// By the name of the column or Metavision's header, else by the times. Throws InputError where
/// these can be two things.
TimeUnit time_unit(const EventFields& columns, const TableContent& content,
                   const std::string& file) {
  const std::vector<double>& times = content.events.times_s();
  if (columns.tick_s) return {std::round(1 / *columns.tick_s), {}};
  for (const auto& [ending, ticks_per_s] :
       {std::pair("_s", 1.0), {"_ms", 1e3}, {"_us", 1e6}, {"_ns", 1e9}}) {
    if (columns.t.ends_with(ending)) return {ticks_per_s, {}};
  }
  if (content.sensor) return {};
  double least = HUGE_VAL, most = -HUGE_VAL;
  bool is_whole = true;
  for (const double time : times) {
    if (!std::isfinite(time)) continue;
    least = std::min(least, time);
    most = std::max(most, time);
    is_whole &= time == std::floor(time);
  }
  if (most < least) return {};
  const double span = most - least;
  const auto doubt = [&](double a_per_s, std::string_view a, double b_per_s, std::string_view b) {
    throw InputError(fmt::format(
        "expected \"unit\" in \"columns\" in the manifest, since the times may be {} (then {} "
        "events take {:g} s) or {} ({:g} s), got none, in {}",
        a, times.size(), span / a_per_s, b, span / b_per_s, file));
  };
  constexpr double kDay_s = 86'400, kFewEvents = 1000;
  if (!is_whole) {
    if (span > kDay_s) doubt(1, "s", 1e6, "us");
    return {1, "since they have decimals"};
  }
  constexpr double kClockOfTheDay_ns = 1e17;  // of 1973; as us it would be of the year 5138
  if (least >= kClockOfTheDay_ns) return {1e9, "since they are of the clock of the day"};
  if (span > kDay_s * 1e6) doubt(1e6, "us", 1e9, "ns");
  // Of a camera: rather this many in a second of a recording of so many seconds or fewer.
  const double seconds = span / 1e6;
  const auto events = static_cast<double>(times.size());
  const double most_events = seconds * (seconds < 1 ? 5e6 : 1e8);
  const double least_events = seconds < 60 ? 0 : seconds * (seconds < 3600 ? 100 : 1e4);
  if (events > kFewEvents && events > most_events) doubt(1e6, "us", 1e3, "ms");
  if (events > kFewEvents && events < least_events) doubt(1e6, "us", 1e9, "ns");
  return {1e6, "since they are whole numbers"};
}

/// The same events at times in seconds.
CompactEvents in_seconds(CompactEvents events, double ticks_per_s) {
  events.divide_times(ticks_per_s);
  return events;
}

/// Puts the events in the order of their times, those of one time as they come. If they were in
/// another, gives the first that was out of place. Times that are not finite have no order: then
/// all stay, and the windows with them are refused.
std::optional<std::int64_t> sort_by_time(CompactEvents& events) {
  const std::vector<double>& times = events.times_s();
  const auto place = std::ranges::is_sorted_until(times) - times.begin();
  const auto is_finite = [](double time_s) { return std::isfinite(time_s); };
  if (place == events.size() || !std::ranges::all_of(times, is_finite)) return std::nullopt;
  std::vector<std::int64_t> order(times.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {},
                           [&](std::int64_t i) { return times[static_cast<std::size_t>(i)]; });
  CompactEvents sorted;
  sorted.reserve(times.size());
  for (const std::int64_t i : order) sorted.push_back(events[i]);
  events = std::move(sorted);
  return place;
}

/// A table is one part.
class TableEvents final : public EventParts {
 public:
  TableEvents(fs::path path, EventFields columns)
      : EventParts(path.string()), path_(std::move(path)), columns_(std::move(columns)) {
    TableContent content = read_table(path_, columns_);
    sensor_ = content.sensor;
    const TimeUnit unit = time_unit(columns_, content, path_.string());
    columns_.tick_s = 1 / unit.ticks_per_s;  // when it is read again
    if (!unit.reason.empty()) {
      notes_.push_back(fmt::format("times are taken to count {}, {}, in {}",
                                   unit.ticks_per_s == 1     ? "seconds"
                                   : unit.ticks_per_s == 1e6 ? "microseconds"
                                                             : "nanoseconds",
                                   unit.reason, path_.string()));
    }
    CompactEvents events = in_seconds(std::move(content.events), unit.ticks_per_s);
    if (const auto place = sort_by_time(events)) {
      notes_.push_back(
          fmt::format("times fall, first at event {}: the events are sorted by time, in {}", *place,
                      path_.string()));
    }
    add_part(std::move(events));
  }

  const std::vector<std::string>& notes() const { return notes_; }
  std::optional<ImageSize> sensor() const { return sensor_; }

 private:
  CompactEvents read_part(std::size_t) const override {
    CompactEvents events =
        in_seconds(read_table(path_, columns_).events, std::round(1 / *columns_.tick_s));
    sort_by_time(events);
    return events;
  }

  fs::path path_;
  EventFields columns_;
  std::optional<ImageSize> sensor_;
  std::vector<std::string> notes_;
};

/// By its header. Throws std::runtime_error, which says what it is.
void require_event_table(const RecordingInput& input, const RecordingOptions& options) {
  const fs::path& path = input.path();
  const std::array<std::string, kColumns> names = names_of(options.columns);
  const auto refuse = [&](const std::string& got) {
    throw InputError(fmt::format(
        "expected events as {} (\"columns\" in the manifest names others), got {}, in {}",
        fmt::join(names, ", "), got, path.string()));
  };
  if (path.extension() == ".npz") {
    const ZipArchive archive(path);
    const auto has = [&](const std::string& name) { return archive.contains(name + ".npy"); };
    if (!std::ranges::all_of(names, has)) {
      refuse(fmt::format("arrays {}", fmt::join(archive.names(), ", ")));
    }
    return;
  }
  std::string_view text = input.beginning();
  if (path.extension() == ".npy") {
    std::size_t begin = 0;
    const NumpyLayout layout =
        parse_npy_header(std::as_bytes(std::span(text)), path.string(), begin);
    std::vector<std::string> found;
    for (const NumpyField& field : layout.fields) found.push_back(field.name);
    const auto has = [&](const std::string& name) { return std::ranges::count(found, name) > 0; };
    if (layout.fields.empty()) {
      if (layout.shape.size() != 2 || layout.shape[1] != kColumns) refuse("an array not [N, 4]");
    } else if (!std::ranges::all_of(names, has)) {
      refuse(fmt::format("fields {}", fmt::join(found, ", ")));
    }
    return;
  }
  const bool is_metavision = take_metavision_header(text).has_value();
  const auto first = CsvReader(text).next();
  if (!first && is_metavision) return;
  if (!first || !layout_of(*first, options.columns)) {
    refuse(first ? fmt::format("a first line {}", fmt::join(first->fields, ", ")) : "no line");
  }
}

bool is_table_file(const fs::path& path) {
  return path.extension() == ".npy" || path.extension() == ".npz" || path.extension() == ".csv";
}

bool is_event_table(const RecordingInput& input, const RecordingOptions& options) try {
  if (!is_table_file(input.path())) return false;
  require_event_table(input, options);
  return true;
} catch (const std::runtime_error&) {  // reported by the reason
  return false;
}

std::optional<RecordingFault> table_fault(const RecordingInput& input,
                                          const RecordingOptions& options) try {
  if (is_table_file(input.path())) require_event_table(input, options);
  return std::nullopt;
} catch (const std::runtime_error& error) {
  return RecordingFault{error.what(), /*is_recording=*/false};
}

}  // namespace

std::unique_ptr<Recording> open_table_recording(const fs::path& path,
                                                const RecordingOptions& options) {
  StoredParts parts{path.string(), {}, nullptr};
  if (!options.sensor && path.extension() != ".csv") sensor_size({}, {}, parts);
  auto events = std::make_unique<TableEvents>(path, options.columns);
  parts.size = sensor_size(events->sensor(), options.sensor, parts);
  parts.notes = events->notes();
  parts.events = std::move(events);
  return make_stored_recording(std::move(parts));
}

constinit const RecordingReader kTableReader{.format = RecordingFormat::kTable,
                                             .fits = is_event_table,
                                             .open = open_table_recording,
                                             .fault = table_fault};

}  // namespace eventgan

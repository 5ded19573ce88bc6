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
#include "stages/recordings/readers/detail/time_unit.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// As StoredEvent has them but for the time, which is first.
enum Column : std::size_t { kTime, kX, kY, kPolarity, kColumns };

std::array<std::string, kColumns> names_of(const EventFields& columns) {
  return {columns.t, columns.x, columns.y, columns.p};
}

/// A row's numbers, in the columns' order, and where a file has them.
using Row = std::array<double, kColumns>;
using Places = std::array<std::size_t, kColumns>;

/// Events with their times as the table has them, and how large its sensor is if it says.
struct TableContent {
  CompactEvents events;
  std::optional<ImageSize> sensor = {};
  std::string note = {};  ///< empty: none
};

StoredEvent event_of(const Row& row) { return {row[kX], row[kY], row[kTime], row[kPolarity]}; }

// ---- columns without names

constexpr Places kMetavisionPlaces{3, 0, 1, 2}, kArrayPlaces{0, 1, 2, 3};
constexpr std::size_t kLookedRows = 10'000;  ///< the first ones tell
constexpr std::size_t kFewRows = 20;         ///< fewer tell nothing

std::string order_text(const Places& places) {
  std::array<std::string_view, kColumns> words;
  for (std::size_t i = 0; i < kColumns; ++i) words[places[i]] = std::array{"t", "x", "y", "p"}[i];
  return fmt::format("{}", fmt::join(words, ", "));
}

/// Which column is what, by those that have polarities and those that never fall: as usual if that
/// may be, else the only way in which one is p and another t, x being before y. None: no way.
std::optional<Places> order_of(std::span<const Row> rows, const Places& usual) {
  std::array<bool, kColumns> may_be_p{}, never_falls{};
  for (std::size_t i = 0; i < kColumns; ++i) {
    const auto value = [i](const Row& row) { return row[i]; };
    const auto others = std::ranges::count_if(rows, [i](const Row& row) {
      const double polarity = signed_polarity(row[i]);
      return polarity != 1 && polarity != 0 && polarity != -1;
    });
    may_be_p[i] = others * 100 <= std::ssize(rows);  // a few are at fault
    never_falls[i] = std::ranges::is_sorted(rows, {}, value);
  }
  const bool has_p = may_be_p[usual[kPolarity]];
  if (rows.size() < kFewRows || (has_p && never_falls[usual[kTime]])) return usual;
  std::vector<Places> ways;
  for (std::size_t t = 0; t < kColumns; ++t) {
    for (std::size_t p = 0; p < kColumns; ++p) {
      if (!never_falls[t] || may_be_p[t] || !may_be_p[p]) continue;
      std::size_t x = 0;
      while (x == t || x == p) ++x;
      ways.push_back({t, x, 6 - t - x - p, p});
    }
  }
  if (ways.size() == 1) return ways[0];
  return has_p ? std::optional(usual) : std::nullopt;
}

/// The same, with a note where it is not as usual. Throws InputError where there is no way.
Places known_order(std::span<const Row> rows, const Places& usual, const std::string& name,
                   std::string& note) {
  const auto places = order_of(rows, usual);
  if (!places) {
    throw InputError(fmt::format(
        "expected columns {} as of tables without names, got values other than 0, 1 and -1 for p, "
        "in {} (the manifest's \"columns\": {{\"t\": \"0\", \"x\": \"1\", \"y\": \"2\", \"p\": "
        "\"3\"}} says which is what)",
        order_text(usual), name));
  }
  if (*places != usual) {
    note = fmt::format(
        "columns without names are taken as {}, since of these t never falls and p has two "
        "values, in {}",
        order_text(*places), name);
  }
  return *places;
}

/// Columns by the numbers that the options give them.
Places places_of(const EventFields& columns, const std::string& name) {
  const std::array<std::string, kColumns> defaults = names_of(EventFields());
  const std::array<std::string, kColumns> names = names_of(columns);
  Places places{};
  for (std::size_t i = 0; i < kColumns; ++i) {
    const bool is_number = names[i].size() == 1 && names[i][0] >= '0' && names[i][0] <= '3';
    if (!is_number && names[i] != defaults[i]) {
      throw InputError(
          "expected fields by names, got an array [N, 4] or lines without a header (\"columns\" "
          "may "
          "have the numbers 0 to 3), in " +
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

bool has_usual_names(const EventFields& columns) {
  return names_of(columns) == names_of(EventFields());
}

// ---- NumPy

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

TableContent read_npy(const fs::path& path, const EventFields& columns) {
  const std::string name = path.string();
  const InputFile file(path);
  const std::vector<std::byte> bytes = file.read_bytes(0, file.size_bytes());
  std::size_t begin = 0;
  if (parse_npy_header(bytes, name, begin).fields.empty()) {
    Places places = places_of(columns, name);
    const TypedArray array = parse_npy(bytes, name);
    if (array.shape.size() != 2 || array.shape[1] != kColumns || array.is_text()) {
      throw InputError("expected numbers [N, 4], got " + array.shape_text() + ", in " + name);
    }
    const auto row_at = [&](std::size_t k, const Places& from) {
      Row row{};
      for (std::size_t i = 0; i < kColumns; ++i) row[i] = array.number(k * kColumns + from[i]);
      return row;
    };
    TableContent content;
    if (has_usual_names(columns)) {
      std::vector<Row> rows;
      for (std::size_t k = 0; k < std::min<std::size_t>(array.shape[0], kLookedRows); ++k) {
        rows.push_back(row_at(k, kArrayPlaces));
      }
      places = known_order(rows, kArrayPlaces, name, content.note);
    }
    content.events.reserve(array.shape[0]);
    for (std::size_t k = 0; k < array.shape[0]; ++k) {
      content.events.push_back(event_of(row_at(k, places)));
    }
    return content;
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
  return {from_columns(arrays, columns, name)};
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
std::optional<Places> find_columns(const CsvRecord& header, const EventFields& columns) {
  Places places{};
  const std::array<std::string, kColumns> names = names_of(columns);
  for (std::size_t i = 0; i < kColumns; ++i) {
    if (std::ranges::count(header.fields, names[i]) != 1) return std::nullopt;
    places[i] = static_cast<std::size_t>(std::ranges::find(header.fields, names[i]) -
                                         header.fields.begin());
  }
  return places;
}

std::optional<double> number_of(std::string_view field) {
  double number = 0;
  const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), number);
  if (error != std::errc() || stop != field.data() + field.size()) return std::nullopt;
  return number;
}

/// The first rows of a table without a header; none if it has one, or not four columns.
std::vector<Row> first_rows(std::string_view text) {
  std::vector<Row> rows;
  CsvReader reader(text);
  for (auto record = reader.next(); record && rows.size() < kLookedRows; record = reader.next()) {
    if (record->fields.size() != kColumns) break;
    Row row{};
    for (std::size_t i = 0; i < kColumns; ++i) {
      const auto number = number_of(record->fields[i]);
      if (!number) return rows;
      row[i] = *number;
    }
    rows.push_back(row);
  }
  return rows;
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

/// Which fields of a CSV are what: by its header, else as in Metavision's or in the order that the
/// first rows tell.
struct CsvLayout {
  Places places{};
  std::size_t fields = 0;
  bool has_header = true;
  std::string note = {};
};

/// `text` is the file's from its first line on, or its beginning, whose last line may be cut.
/// Throws InputError; none: it is no table of events, as far as its first line tells.
std::optional<CsvLayout> layout_of(std::string_view text, const EventFields& columns,
                                   bool is_metavision, const std::string& name) {
  const auto first = CsvReader(text).next();
  if (!first) return std::nullopt;
  if (const auto places = find_columns(*first, columns)) {
    return CsvLayout{*places, first->fields.size()};
  }
  const std::vector<Row> rows = first_rows(text.substr(0, text.rfind('\n')));
  if (rows.empty()) return std::nullopt;
  CsvLayout layout{kMetavisionPlaces, kColumns, false};
  if (!has_usual_names(columns)) {
    layout.places = places_of(columns, name);
  } else if (!is_metavision) {
    const bool are_whole =
        std::ranges::all_of(rows[0], [](double number) { return number == std::floor(number); });
    const bool is_known = rows.size() >= kFewRows && order_of(rows, kMetavisionPlaces);
    if (!are_whole && !is_known) return std::nullopt;
    layout.places = known_order(rows, kMetavisionPlaces, name, layout.note);
  }
  return layout;
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
  const auto layout = layout_of(rest, columns, content.sensor.has_value(), path.string());
  if (!layout) {
    refuse("expected a header line with " + columns.t + ", " + columns.x + ", " + columns.y +
               " and " + columns.p + " (\"columns\" in the manifest names others), got another",
           record->line);
  }
  content.note = layout->note;
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
      const auto number = number_of(record->fields[layout->places[i]]);
      if (!number) refuse("expected a number of " + names[i] + ", got another field", record->line);
      row[i] = *number;
    }
    content.events.push_back(event_of(row));
  }
  return content;
}

TableContent read_table(const fs::path& path, const EventFields& columns) try {
  if (path.extension() == ".npy") return read_npy(path, columns);
  if (path.extension() == ".npz") return {read_npz(path, columns)};
  return read_csv(path, columns);
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

/// By the name of the column or Metavision's header, else by the times. Throws InputError where
/// these can be two things.
TimeUnit time_unit(const EventFields& columns, const TableContent& content,
                   const std::string& file) {
  if (columns.tick_s) return {std::round(1 / *columns.tick_s), {}};
  for (const auto& [ending, ticks_per_s] :
       {std::pair("_s", 1.0), {"_ms", 1e3}, {"_us", 1e6}, {"_ns", 1e9}}) {
    if (columns.t.ends_with(ending)) return {ticks_per_s, {}};
  }
  return content.sensor ? TimeUnit() : tell_time_unit(content.events, file);
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
    if (!content.note.empty()) notes_.push_back(content.note);
    if (!unit.found.empty()) {
      notes_.push_back(
          fmt::format("times are taken to count {}, in {}", unit.found, path_.string()));
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
  if (!layout_of(text, options.columns, is_metavision, path.string())) {
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

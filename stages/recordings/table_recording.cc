#include "stages/recordings/detail/table_recording.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/archives/detail/numpy_arrays.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/base/files/csv_records.h"
#include "stages/base/files/input_file.h"
#include "stages/recordings/detail/event_parts.h"
#include "stages/recordings/detail/recording_reader.h"
#include "stages/recordings/detail/stored_recording.h"

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

StoredEvent event_of(const Row& row, double ticks_per_s) {
  return {row[kX], row[kY], row[kTime] / ticks_per_s, row[kPolarity]};
}

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
  const double ticks_per_s = std::round(1 / columns.tick_s);
  CompactEvents events;
  events.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    Row row{};
    for (std::size_t i = 0; i < kColumns; ++i) row[i] = arrays[i].number(k);
    events.push_back(event_of(row, ticks_per_s));
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
    const double ticks_per_s = std::round(1 / columns.tick_s);
    CompactEvents events;
    events.reserve(array.shape[0]);
    for (std::size_t k = 0; k < array.shape[0]; ++k) {
      Row row{};
      for (std::size_t i = 0; i < kColumns; ++i) row[i] = array.number(k * kColumns + places[i]);
      events.push_back(event_of(row, ticks_per_s));
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

CompactEvents read_csv(const fs::path& path, const EventFields& columns) {
  const std::string text = read_text_file(path);
  const std::array<std::string, kColumns> names = names_of(columns);
  const auto refuse = [&](const std::string& fault, int line) {
    throw InputError(fault + ", in " + path.string() + " (line " + std::to_string(line) + ")");
  };
  CsvReader reader(text);
  const std::optional<CsvRecord> header = reader.next();
  if (!header) refuse("expected a header line, got none", 1);
  const auto places = find_columns(*header, columns);
  if (!places) {
    refuse("expected a header line with " + columns.t + ", " + columns.x + ", " + columns.y +
               " and " + columns.p + ", got another",
           header->line);
  }
  const double ticks_per_s = std::round(1 / columns.tick_s);
  CompactEvents events;
  events.reserve(static_cast<std::size_t>(std::ranges::count(text, '\n')));
  while (const std::optional<CsvRecord> record = reader.next()) {
    if (record->fields.empty()) refuse(record->fault, record->line);
    if (record->fields.size() != header->fields.size()) {
      refuse("expected " + std::to_string(header->fields.size()) + " fields, got " +
                 std::to_string(record->fields.size()),
             record->line);
    }
    Row row{};
    for (std::size_t i = 0; i < kColumns; ++i) {
      const std::string_view field = record->fields[(*places)[i]];
      const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), row[i]);
      if (error != std::errc() || stop != field.data() + field.size()) {
        refuse("expected a number of " + names[i] + ", got another field", record->line);
      }
    }
    events.push_back(event_of(row, ticks_per_s));
  }
  return events;
}

CompactEvents read_table(const fs::path& path, const EventFields& columns) try {
  if (path.extension() == ".npy") return read_npy(path, columns);
  if (path.extension() == ".npz") return read_npz(path, columns);
  return read_csv(path, columns);
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

/// A table is one part.
class TableEvents final : public EventParts {
 public:
  TableEvents(fs::path path, EventFields columns)
      : EventParts(path.string()), path_(std::move(path)), columns_(std::move(columns)) {
    add_part(read_part(0));
  }

 private:
  CompactEvents read_part(std::size_t) const override { return read_table(path_, columns_); }

  fs::path path_;
  EventFields columns_;
};

/// By its header.
bool is_event_table(const RecordingInput& input, const RecordingOptions& options) try {
  const fs::path& path = input.path();
  const std::array<std::string, kColumns> names = names_of(options.columns);
  if (path.extension() == ".npz") {
    const ZipArchive archive(path);
    return std::ranges::all_of(
        names, [&](const std::string& name) { return archive.contains(name + ".npy"); });
  }
  const bool is_npy = path.extension() == ".npy";
  if (!is_npy && path.extension() != ".csv") return false;
  const std::string_view text = input.beginning();
  if (is_npy) {
    std::size_t begin = 0;
    const NumpyLayout layout =
        parse_npy_header(std::as_bytes(std::span(text)), path.string(), begin);
    if (layout.fields.empty()) return layout.shape.size() == 2 && layout.shape[1] == kColumns;
    return std::ranges::all_of(names, [&](const std::string& name) {
      return std::ranges::find(layout.fields, name, &NumpyField::name) != layout.fields.end();
    });
  }
  const auto header = CsvReader(text).next();
  return header && find_columns(*header, options.columns).has_value();
} catch (const std::runtime_error&) {  // reported when it is opened
  return false;
}

}  // namespace

std::unique_ptr<Recording> open_table_recording(const fs::path& path,
                                                const RecordingOptions& options) {
  if (!options.sensor) {
    throw InputError(
        "expected the sensor's size as \"sensor\" in the manifest, since a table does "
        "not tell it, got none, in " +
        path.string());
  }
  return make_stored_recording({.name = path.string(),
                                .size = *options.sensor,
                                .events = std::make_unique<TableEvents>(path, options.columns)});
}

constinit const RecordingReader kTableReader{
    .format = RecordingFormat::kTable, .fits = is_event_table, .open = open_table_recording};

}  // namespace eventgan

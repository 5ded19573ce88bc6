#include "stages/recordings/writers/event_columns_writer.h"

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "stages/base/hdf5/hdf5_output_file.h"
#include "stages/recordings/readers/hdf5_layouts.h"
#include "stages/recordings/writers/detail/growing_dataset.h"
#include "stages/recordings/writers/detail/require.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMicrosecondsPerMillisecond = 1000;

template <class Number>
GrowingDataset<Number> column(hid_t file, const std::string& path) {
  return {file, path, {}, {kEventsPerChunk}, kEventsPerChunk};
}

void write_number(hid_t file, const std::string& path, std::int64_t number) {
  Hdf5Handle dataset = create_dataset(file, path, element_type<std::int64_t>(), space_of({}, path),
                                      creation_properties(H5P_DATASET_CREATE));
  write_elements(dataset, path, std::vector<std::int64_t>{number});
  dataset.close(path);
}

}  // namespace

void require_recordable(std::span<const StampedEvent> events, ImageSize size,
                        std::int64_t first_us) {
  for (const StampedEvent& event : events) {
    require(event.x < size.width && event.y < size.height, "expected events within the size");
    require(event.t_us >= first_us,
            "expected events in time order, not before the recording's begin");
    first_us = event.t_us;
  }
}

struct EventColumnsWriter::File {
  Hdf5OutputFile hdf5;
  ColumnFile layout;
  ImageSize size;
  std::int64_t offset_us;
  std::optional<GrowingDataset<std::uint16_t>> x, y;
  std::optional<GrowingDataset<std::uint8_t>> p;
  std::optional<GrowingDataset<std::uint32_t>> t_after_offset;
  std::optional<GrowingDataset<std::int64_t>> t;
  std::optional<GrowingDataset<std::uint64_t>> ms_to_idx;
  std::int64_t last_us = 0;  ///< from the offset on
  std::uint64_t event_count = 0;
  std::int64_t milliseconds = 0;  ///< entries of ms_to_idx so far

  File(const std::filesystem::path& target, ColumnFile whose, ImageSize of, std::int64_t offset)
      : hdf5(target), layout(whose), size(of), offset_us(offset) {}

  void create() {
    const ColumnLayout names = dsec_layout();
    create_group(hdf5.id(), names.events).close(names.events);
    x = column<std::uint16_t>(hdf5.id(), names.column("x"));
    y = column<std::uint16_t>(hdf5.id(), names.column("y"));
    p = column<std::uint8_t>(hdf5.id(), names.column("p"));
    if (layout == ColumnFile::kDsec) {
      t_after_offset = column<std::uint32_t>(hdf5.id(), names.column("t"));
      ms_to_idx = column<std::uint64_t>(hdf5.id(), names.ms_index);
      write_number(hdf5.id(), names.t_offset, offset_us);
      write_attribute(hdf5.id(), "height", size.height);
      write_attribute(hdf5.id(), "width", size.width);
    } else {
      t = column<std::int64_t>(hdf5.id(), names.column("t"));
      write_number(hdf5.id(), names.size.at(0), size.height);
      write_number(hdf5.id(), names.size.at(1), size.width);
    }
  }

  /// Gives each millisecond up to `until_us`, itself included, that has no event yet the next one.
  void index_until(std::int64_t until_us, std::vector<std::uint64_t>& entries) {
    while (milliseconds * kMicrosecondsPerMillisecond <= until_us) {
      entries.push_back(event_count);
      ++milliseconds;
    }
  }
};

EventColumnsWriter::EventColumnsWriter(const std::filesystem::path& file, ColumnFile layout,
                                       ImageSize size, std::int64_t offset_us) {
  constexpr int kMost = std::numeric_limits<std::uint16_t>::max() + 1;
  require(size.height > 0 && size.width > 0 && size.height <= kMost && size.width <= kMost,
          "expected an image size of 1x1 to 65536x65536");
  file_ = std::make_unique<File>(file, layout, size, layout == ColumnFile::kDsec ? offset_us : 0);
  file_->hdf5.write([&] { file_->create(); });
}

EventColumnsWriter::~EventColumnsWriter() = default;

void EventColumnsWriter::add_events(std::span<const StampedEvent> events) {
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> p;
  std::vector<std::int64_t> t;
  require_recordable(events, file_->size, file_->offset_us + file_->last_us);
  for (const StampedEvent& event : events) {
    x.push_back(event.x);
    y.push_back(event.y);
    p.push_back(event.positive ? 1 : 0);
    t.push_back(event.t_us - file_->offset_us);
  }
  const std::int64_t last_us = t.empty() ? file_->last_us : t.back();
  const bool is_dsec = file_->layout == ColumnFile::kDsec;
  require(!is_dsec || last_us <= std::numeric_limits<std::uint32_t>::max(),
          "expected events within 2^32 microseconds of the recording's begin");
  file_->last_us = last_us;
  std::vector<std::uint64_t> entries;
  for (const std::int64_t time_us : t) {
    if (is_dsec) file_->index_until(time_us, entries);
    ++file_->event_count;
  }
  file_->hdf5.write([&] {
    file_->x->append(x);
    file_->y->append(y);
    file_->p->append(p);
    if (is_dsec) {
      file_->t_after_offset->append(std::vector<std::uint32_t>(t.begin(), t.end()));
      file_->ms_to_idx->append(entries);
    } else {
      file_->t->append(t);
    }
  });
}

void EventColumnsWriter::commit(std::int64_t end_us) {
  const std::int64_t duration_us = end_us - file_->offset_us;
  require(duration_us >= file_->last_us, "expected an end that is not before the last event");
  const bool is_dsec = file_->layout == ColumnFile::kDsec;
  require(!is_dsec || duration_us <= std::numeric_limits<std::uint32_t>::max(),
          "expected an end within 2^32 microseconds of the recording's begin");
  std::vector<std::uint64_t> entries;
  if (is_dsec) file_->index_until(duration_us + kMicrosecondsPerMillisecond - 1, entries);
  file_->hdf5.write([&] {
    file_->x->close();
    file_->y->close();
    file_->p->close();
    if (is_dsec) {
      file_->t_after_offset->close();
      file_->ms_to_idx->append(entries);
      file_->ms_to_idx->close();
    } else {
      file_->t->close();
    }
    file_->hdf5.close();
  });
  file_->hdf5.output().publish();
}

void write_rectify_map(const std::filesystem::path& file, ImageSize size) {
  const auto width = static_cast<hsize_t>(size.width);
  std::vector<float> places;
  places.reserve(2 * size.pixel_count());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      places.insert(places.end(), {static_cast<float>(x), static_cast<float>(y)});
    }
  }
  Hdf5OutputFile hdf5(file);
  hdf5.write([&] {
    GrowingDataset<float> map(hdf5.id(), "rectify_map", {width, 2}, {1, width, 2}, 1);
    map.append(places);
    map.close();
    hdf5.close();
  });
  hdf5.output().publish();
}

}  // namespace eventgan

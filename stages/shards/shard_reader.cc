#include "stages/shards/shard_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/shards/codec/chunk_filters.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/detail/shard_reader.h"
#include "stages/shards/shard_rows.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

/// Shuffle, deflate (at level 0 none), fletcher32.
bool has_own_filters(hid_t volume, int deflate_level) {
  const Hdf5Handle creation(H5Dget_create_plist(volume), H5Pclose, "read", kVolumePath);
  std::vector<H5Z_filter_t> found;
  const int count = checked(H5Pget_nfilters(creation), "read", kVolumePath);
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    unsigned config = 0;
    found.push_back(H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr, 0,
                                   nullptr, &config));
  }
  return deflate_level == 0
             ? found == std::vector<H5Z_filter_t>{H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32}
             : found == std::vector<H5Z_filter_t>{H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE,
                                                  H5Z_FILTER_FLETCHER32};
}

bool is_counted(const ColumnSpec& spec) {
  constexpr const char* kCounted[] = {"/pairs/sample_id",      "/pairs/gap_frames",
                                      "/labels/boxes/offsets", "/labels/boxes/class_id",
                                      "/labels/poses/offsets", "/valid"};
  return spec.optional() ||
         std::ranges::find(kCounted, std::string_view(spec.path)) != std::end(kCounted);
}

bool is_overview(const ColumnSpec& spec) {
  constexpr const char* kSeen[] = {"/events/statistics/sum_positive",
                                   "/events/statistics/sum_negative",
                                   "/events/statistics/flags",
                                   "/pairs/sample_id",
                                   "/pairs/sequence",
                                   "/pairs/gap_frames",
                                   "/pairs/gap_s",
                                   "/pairs/label_index",
                                   "/labels/boxes/offsets",
                                   "/labels/boxes/xyxy",
                                   "/labels/boxes/class_id",
                                   "/labels/boxes/ignore",
                                   "/valid"};
  return std::ranges::find(kSeen, std::string_view(spec.path)) != std::end(kSeen);
}

/// Reads column after column and notes what is wrong.
class ColumnReader {
 public:
  ColumnReader(ShardFile& shard, std::string path, std::vector<std::string>& faults,
               Columns columns)
      : shard_(shard), path_(std::move(path)), faults_(faults), columns_(columns) {}

  template <class Element>
  void operator()(const ColumnSpec& spec, std::vector<Element>& column) {
    if (columns_ == Columns::kCounted && !is_counted(spec)) return;
    if (columns_ == Columns::kOverview && !is_overview(spec)) return;
    if (spec.optional() && H5Lexists(shard_.file, spec.path, H5P_DEFAULT) <= 0) return;
    if (columns_ == Columns::kCounted && spec.is_image) return column.resize(1);
    Dims dims;
    try {
      column = read_dataset<Element>(shard_.file, spec.path, dims);
    } catch (const Hdf5Error& error) {
      return fault(error.what());
    }
    // Rows that faulty offsets should have counted are not worth a line each.
    const std::optional<hsize_t> rows = expected_rows(spec.rows);
    Dims expected{rows.value_or(dims.empty() ? 0 : dims[0])};
    expected.insert(expected.end(), spec.inner.begin(), spec.inner.end());
    if (dims != expected) {
      return fault("expected shape " + shape_text(expected) + " of " + spec.path + ", got " +
                   shape_text(dims));
    }
    if constexpr (std::is_same_v<Element, std::int64_t>) {
      if (spec.rows == Rows::kOffsets) check_offsets(spec, column);
    }
  }

 private:
  void fault(const std::string& what) { faults_.push_back(path_ + ": " + what); }

  std::optional<hsize_t> expected_rows(Rows rows) const {
    const auto samples = static_cast<hsize_t>(shard_.header.sample_count);
    switch (rows) {
      case Rows::kSamples:
        return samples;
      case Rows::kOffsets:
        return samples + 1;
      case Rows::kBoxes:
        return boxes_;
      case Rows::kPersons:
        return persons_;
    }
    return std::nullopt;
  }

  void check_offsets(const ColumnSpec& spec, const std::vector<std::int64_t>& offsets) {
    if (offsets.front() != 0 || !std::is_sorted(offsets.begin(), offsets.end())) {
      return fault("expected " + std::string(spec.path) + " to ascend from 0, got other numbers");
    }
    const auto rows = static_cast<hsize_t>(offsets.back());
    (&offsets == &shard_.tables.boxes.offsets ? boxes_ : persons_) = rows;
  }

  ShardFile& shard_;
  std::string path_;
  std::vector<std::string>& faults_;
  Columns columns_;
  std::optional<hsize_t> boxes_;
  std::optional<hsize_t> persons_;
};

}  // namespace

ShardFile open_shard(const std::filesystem::path& path, std::vector<std::string>& faults,
                     Columns columns) {
  if (std::error_code ignored; !std::filesystem::exists(path, ignored)) {
    throw InputError("expected a shard, got no file, in " + path.string());
  }
  ShardFile shard;
  require_regular_file(path);
  try {
    shard.file = open_hdf5_file(path);
    shard.header = read_header(shard.file);
    shard.volume = open_object(shard.file, kVolumePath);
    stored_volume_size(shard.header);
    shard.has_own_filters = has_own_filters(shard.volume, shard.header.deflate_level);
  } catch (const std::exception& error) {
    throw std::runtime_error(path.string() + ": " + error.what());
  }
  visit_columns(shard.tables, shard.header, ColumnReader(shard, path.string(), faults, columns));
  return shard;
}

std::vector<std::byte> read_stored_volume(const ShardFile& shard, int slot) {
  const Dims dims = dims_of(shard.volume, kVolumePath);
  std::vector<std::byte> bytes(stored_volume_size(shard.header));
  // Read as it is stored: HDF5's own conversion from float16 is slow.
  read_block(shard.volume, std::string(kVolumePath) + "[" + std::to_string(slot) + "]",
             {static_cast<hsize_t>(slot), 0, 0, 0}, {1, dims[1], dims[2], dims[3]},
             volume_type(shard.header.dtype), bytes.data());
  return bytes;
}

std::vector<std::byte> read_stored_chunk(const ShardFile& shard, int slot) {
  const std::string where = std::string(kVolumePath) + "[" + std::to_string(slot) + "]";
  const hsize_t offset[4] = {static_cast<hsize_t>(slot), 0, 0, 0};
  unsigned skipped_filters = 0;
  haddr_t address = HADDR_UNDEF;
  hsize_t size_bytes = 0;
  // H5Dget_chunk_storage_size fails on a chunk that was not written if others were.
  checked(H5Dget_chunk_info_by_coord(shard.volume, offset, &skipped_filters, &address, &size_bytes),
          "find", where);
  if (address == HADDR_UNDEF) return {};
  std::vector<std::byte> chunk(size_bytes);
  checked(H5Dread_chunk(shard.volume, H5P_DEFAULT, offset, &skipped_filters, chunk.data()), "read",
          where);
  if (skipped_filters != 0) {
    throw Hdf5Error("expected a chunk with all filters, got one without some, in " + where);
  }
  // A copy of damaged bytes would get a SHA-256 of its own, and count as sound from then on.
  if (!ends_in_fletcher32(chunk)) {
    throw Hdf5Error("expected a chunk that ends in its checksum, got another, in " + where);
  }
  return chunk;
}

namespace {

/// With a line for each fault.
void throw_if_any(const std::vector<std::string>& faults) {
  if (faults.empty()) return;
  throw std::runtime_error(fmt::format("{}", fmt::join(faults, "\n")));
}

}  // namespace

ShardOverview read_overview(const std::filesystem::path& file) {
  std::vector<std::string> faults;
  const Hdf5Lock lock;
  ShardFile shard = open_shard(file, faults, Columns::kOverview);
  throw_if_any(faults);
  return {std::move(shard.header), std::move(shard.tables)};
}

struct ShardReader::State {
  std::string path;
  ShardFile shard;

  void check_slot(int slot) const {
    if (slot >= 0 && slot < shard.header.sample_count) return;
    throw std::out_of_range("expected a sample 0.." +
                            std::to_string(shard.header.sample_count - 1) + ", got " +
                            std::to_string(slot) + ", in " + path);
  }

  /// Empty if there is none, or it went through other filters.
  std::vector<std::byte> chunk_if_own(int slot) const {
    if (!shard.has_own_filters) return {};
    const Hdf5Lock lock;
    return read_stored_chunk(shard, slot);
  }
};

ShardReader::ShardReader(const std::filesystem::path& file) : state_(std::make_unique<State>()) {
  state_->path = file.string();
  std::vector<std::string> faults;
  {
    const Hdf5Lock lock;
    state_->shard = open_shard(file, faults);
  }
  throw_if_any(faults);
}

ShardReader::~ShardReader() = default;
ShardReader::ShardReader(ShardReader&&) noexcept = default;

const ShardHeader& ShardReader::header() const { return state_->shard.header; }

const ShardTables& ShardReader::tables() const { return state_->shard.tables; }

ShardContents ShardReader::contents() const { return contents_of(state_->shard.tables, header()); }

ShardSample ShardReader::sample(int slot) const {
  state_->check_slot(slot);
  return extract_row(state_->shard.header, state_->shard.tables, slot);
}

std::vector<float> ShardReader::volume(int slot) const {
  state_->check_slot(slot);
  const ShardFile& shard = state_->shard;
  const float scale = shard.tables.events.scale[static_cast<std::size_t>(slot)];
  std::vector<float> volume(shard.header.volume.value_count());
  // Inflated here, which threads can do side by side. Where no chunk was written, or it is not as
  // it should be, HDF5 has the word.
  try {
    if (decode_volume(state_->chunk_if_own(slot), shard.header.dtype, shard.header.deflate_level,
                      scale, volume)) {
      return volume;
    }
  } catch (const Hdf5Error&) {  // the same again, in HDF5's words
  }
  const Hdf5Lock lock;
  try {
    dequantize(read_stored_volume(shard, slot), shard.header.dtype, scale, volume);
    return volume;
  } catch (const Hdf5Error& error) {
    throw std::runtime_error(state_->path + ": " + error.what());
  }
}

std::vector<std::byte> ShardReader::stored_chunk(int slot) const {
  state_->check_slot(slot);
  const Hdf5Lock lock;
  try {
    return read_stored_chunk(state_->shard, slot);
  } catch (const Hdf5Error& error) {
    throw std::runtime_error(state_->path + ": " + error.what());
  }
}

}  // namespace eventgan

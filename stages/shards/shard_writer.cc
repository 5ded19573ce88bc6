#include "stages/shards/shard_writer.h"

#include <cstdint>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "manifests/files/sha256.h"
#include "stages/base/hdf5/hdf5_output_file.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/shard_rows.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

struct ShardWriter::State {
  ShardHeader header;
  Hdf5OutputFile file;
  Hdf5Handle volume;
  ShardTables tables;
  int next_slot = 0;
  bool committed = false;

  State(const std::filesystem::path& folder, const ShardHeader& of)
      : header(of), file(folder / of.name) {}

  /// Runs HDF5 calls; errors name the file.
  template <class Work>
  void write(Work&& work) {
    try {
      file.write(work);
    } catch (const Hdf5Error& error) {
      throw std::runtime_error(file.target().string() + ": " + error.what());
    }
  }

  void write_chunk(std::span<const std::byte> chunk);
  void write_columns();
  ShardReceipt flush();
};

void ShardWriter::State::write_chunk(std::span<const std::byte> chunk) {
  const hsize_t offset[4] = {static_cast<hsize_t>(next_slot), 0, 0, 0};
  constexpr std::uint32_t kNoFilterSkipped = 0;
  write([&] {
    checked(
        H5Dwrite_chunk(volume, H5P_DEFAULT, kNoFilterSkipped, offset, chunk.size(), chunk.data()),
        "write", "/events/volume");
  });
}

void ShardWriter::State::write_columns() {
  const ShardTables& columns = tables;
  const auto rows = [&](Rows kind) {
    switch (kind) {
      case Rows::kSamples:
        return columns.valid.size();
      case Rows::kOffsets:
        return columns.valid.size() + 1;
      case Rows::kBoxes:
        return columns.boxes.class_id.size();
      case Rows::kPersons:
        return columns.poses.scale.size();
    }
    throw std::logic_error("unknown kind of rows");
  };
  visit_columns(columns, header, [&](const ColumnSpec& spec, const auto& column) {
    if (spec.optional() && column.empty()) return;
    Dims dims{rows(spec.rows)};
    dims.insert(dims.end(), spec.inner.begin(), spec.inner.end());
    write_dataset(file.id(), spec.path, column, dims, header.deflate_level,
                  spec.is_image ? 1 : kRowsPerChunk);
  });
}

/// Step 3, and the hash of what is read back.
ShardReceipt ShardWriter::State::flush() {
  const std::filesystem::path& temporary = file.output().temporary();
  try {
    file.output().sync();
    return {sha256_of_file(temporary),
            static_cast<std::int64_t>(std::filesystem::file_size(temporary)),
            contents_of(tables, header)};
  } catch (const std::runtime_error&) {
    std::error_code unknown;
    if (std::filesystem::exists(temporary, unknown) || unknown) throw;
    std::throw_with_nested(UnfinishedShardLost(
        "expected the file that was being written, got nothing: another process "
        "deleted it after an hour without a write, in " +
        file.target().string()));
  }
}

ShardWriter::ShardWriter(const std::filesystem::path& folder, const ShardHeader& header) {
  stored_volume_size(header);
  state_ = std::make_unique<State>(folder, header);
  state_->write([&] { state_->volume = create_objects(state_->file.id(), header); });
}

ShardWriter::~ShardWriter() = default;

void ShardWriter::append(const ShardSample& sample, std::span<const std::byte> chunk) {
  State& state = *state_;
  const std::string where = " (" + sample.sample_id + ", " + state.header.name + ")";
  if (state.committed || state.next_slot == state.header.sample_count) {
    throw std::logic_error("expected no sample after the last slot, got one" + where);
  }
  if (sample.valid == chunk.empty()) {
    throw std::logic_error("expected a volume for a valid sample and none for another" + where);
  }
  append_row(state.header, sample, state.tables);
  if (!chunk.empty()) state.write_chunk(chunk);
  ++state.next_slot;
}

ShardReceipt ShardWriter::commit() {
  State& state = *state_;
  if (state.committed) throw std::logic_error("a shard is committed once: " + state.header.name);
  if (state.next_slot != state.header.sample_count) {
    throw std::logic_error("expected " + std::to_string(state.header.sample_count) +
                           " samples, got " + std::to_string(state.next_slot) + ", in " +
                           state.header.name);
  }
  state.write([&] {
    state.write_columns();
    describe_columns(state.file.id(), state.header,
                     contents_of(state.tables, state.header).optional_columns);
    state.volume.close("/events/volume");
    state.file.close();
  });
  ShardReceipt receipt = state.flush();
  state.file.output().publish();
  state.committed = true;
  return receipt;
}

}  // namespace eventgan

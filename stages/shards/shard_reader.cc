#include "stages/shards/shard_reader.h"

#include <stdexcept>
#include <string>

#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_file_internal.h"
#include "stages/shards/shard_objects_internal.h"
#include "stages/shards/shard_rows.h"

namespace eventgan {

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
  if (faults.empty()) return;
  std::string message;
  for (const std::string& fault : faults) message += (message.empty() ? "" : "\n") + fault;
  throw std::runtime_error(message);
}

ShardReader::~ShardReader() = default;
ShardReader::ShardReader(ShardReader&&) noexcept = default;

const ShardHeader& ShardReader::header() const { return state_->shard.header; }

ShardContents ShardReader::contents() const {
  return contents_of(state_->shard.tables, header().label_schema);
}

ShardSample ShardReader::sample(int slot) const {
  state_->check_slot(slot);
  return extract_row(state_->shard.header, state_->shard.tables, slot);
}

std::vector<float> ShardReader::volume(int slot) const {
  state_->check_slot(slot);
  const ShardFile& shard = state_->shard;
  const float scale = shard.tables.events.scale[static_cast<std::size_t>(slot)];
  // Inflated here, which threads can do side by side. Where no chunk was written, or it is not as
  // it should be, HDF5 has the word.
  try {
    const std::vector<std::byte> chunk = state_->chunk_if_own(slot);
    if (const auto numbers = decode_chunk(chunk, shard.header.dtype, shard.header.deflate_level,
                                          stored_volume_size(shard.header))) {
      return dequantize(*numbers, shard.header.dtype, scale);
    }
  } catch (const Hdf5Error&) {  // the same again, in HDF5's words
  }
  const Hdf5Lock lock;
  try {
    return dequantize(read_stored_volume(shard, slot), shard.header.dtype, scale);
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

#include "stages/shards/shard_reader.h"

#include <stdexcept>
#include <string>

#include "stages/shards/codec/quantization.h"
#include "stages/shards/shard_file_internal.h"
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
};

ShardReader::ShardReader(const std::filesystem::path& file) : state_(std::make_unique<State>()) {
  state_->path = file.string();
  std::vector<std::string> faults;
  state_->shard = open_shard(file, faults);
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
  quiet_hdf5_errors();
  state_->check_slot(slot);
  const ShardFile& shard = state_->shard;
  try {
    return dequantize(read_stored_volume(shard, slot), shard.header.dtype,
                      shard.tables.events.scale[static_cast<std::size_t>(slot)]);
  } catch (const Hdf5Error& error) {
    throw std::runtime_error(state_->path + ": " + error.what());
  }
}

std::vector<std::byte> ShardReader::stored_chunk(int slot) const {
  quiet_hdf5_errors();
  state_->check_slot(slot);
  try {
    return read_stored_chunk(state_->shard, slot);
  } catch (const Hdf5Error& error) {
    throw std::runtime_error(state_->path + ": " + error.what());
  }
}

}  // namespace eventgan

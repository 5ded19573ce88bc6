#include "pipeline/conversion/shard_rewrite.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/documents/marker.h"
#include "pipeline/folder/shard_backup.h"
#include "stages/base/files/atomic_file.h"
#include "stages/base/files/input_file.h"

namespace eventgan {
namespace {

/// Why the sample in `slot` was quarantined; empty if it was not.
std::string reason_of(const ShardMarker& marker, int slot) {
  const auto found =
      std::ranges::lower_bound(marker.quarantined, slot, {}, &QuarantinedSample::slot);
  return found != marker.quarantined.end() && found->slot == slot ? found->reason : "";
}

}  // namespace

ShardRewrite::ShardRewrite(std::filesystem::path folder, ShardMarker marker,
                           std::optional<ImageSize> volume_size)
    : folder_(std::move(folder)),
      before_(std::move(marker)),
      reader_(folder_ / before_.shard),
      header_(reader_.header()) {
  if (volume_size) header_.volume.size = *volume_size;
  marker_.shard = before_.shard;
  marker_.plan_hash = before_.plan_hash;
  // What the shard has cost so far; the work of a retry comes on top.
  marker_.stage_seconds = before_.stage_seconds;
  marker_.wall_seconds = before_.wall_seconds;
  marker_.peak_bytes = before_.peak_bytes;
}

void ShardRewrite::redo(int slot, const SampleMessage& message) {
  for (std::size_t stage = 0; stage < kStageCount; ++stage) {
    marker_.stage_seconds[kStageNames[stage]] += message.seconds[stage];
  }
  if (!is_news(slot, message.sample)) return;  // copied with the rest, if at all
  if (!writer_) writer_ = std::make_unique<ShardWriter>(folder_, header_);
  copy_before(slot);
  append(message.sample, message.chunk);
}

bool ShardRewrite::is_news(int slot, const ShardSample& sample) const {
  return sample.valid || sample.fault != reason_of(before_, slot) ||
         sample.annotation.original != reader_.sample(slot).annotation.original;
}

void ShardRewrite::copy_before(int slot) {
  while (marker_.samples < slot) {
    ShardSample sample = reader_.sample(marker_.samples);
    sample.fault = reason_of(before_, marker_.samples);
    append(sample, reader_.stored_chunk(marker_.samples));
  }
}

void ShardRewrite::append(const ShardSample& sample, std::span<const std::byte> chunk) {
  writer_->append(sample, chunk);
  if (sample.valid) {
    ++marker_.valid;
  } else {
    marker_.quarantined.push_back({marker_.samples, sample.sample_id, sample.fault});
  }
  ++marker_.samples;
}

bool ShardRewrite::commit() {
  if (!writer_) return false;
  copy_before(reader_.header().sample_count);
  const std::filesystem::path marker_file = folder_ / marker_name(marker_.shard);
  if (parse_marker(read_text_file(marker_file), marker_file.string()).sha256 != before_.sha256) {
    throw std::runtime_error("expected the shard that the retry started with, got another, in " +
                             (folder_ / marker_.shard).string() + ": run retry again");
  }
  ShardBackup backup(folder_ / marker_.shard);
  ShardReceipt receipt = writer_->commit();
  marker_.sha256 = receipt.sha256;
  marker_.size_bytes = receipt.size_bytes;
  marker_.contents = std::move(receipt.contents);
  const std::string text = to_json(marker_);
  try {
    write_file_atomically(marker_file, text);
  } catch (const std::runtime_error&) {
    // The marker may be in place all the same: its name is, only not known to be on disk.
    if (read_text_file(marker_file) == text) backup.release();
    throw;
  }
  backup.release();
  return true;
}

}  // namespace eventgan

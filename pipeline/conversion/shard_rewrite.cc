#include "pipeline/conversion/shard_rewrite.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_backup.h"

namespace eventgan {
namespace {

/// Why the sample in `slot` was quarantined; empty if it was not.
std::string reason_of(const CommitRecord& record, int slot) {
  const auto found =
      std::ranges::lower_bound(record.quarantined, slot, {}, &QuarantinedSample::slot);
  return found != record.quarantined.end() && found->slot == slot ? found->reason : "";
}

}  // namespace

ShardRewrite::ShardRewrite(std::filesystem::path folder, CommitRecord record,
                           std::optional<ImageSize> volume_size,
                           const std::optional<std::vector<std::string>>& class_names)
    : folder_(std::move(folder)),
      before_(std::move(record)),
      reader_(folder_ / before_.shard),
      header_(reader_.header()) {
  if (volume_size) header_.volume.size = *volume_size;
  if (class_names) name_classes(*class_names);
  record_.shard = before_.shard;
  record_.plan_hash = before_.plan_hash;
  record_.inputs = before_.inputs;
  // What the shard has cost so far; the work of a retry comes on top.
  record_.stage_seconds = before_.stage_seconds;
  record_.wall_seconds = before_.wall_seconds;
  record_.peak_bytes = before_.peak_bytes;
}

void ShardRewrite::name_classes(const std::vector<std::string>& class_names) {
  std::vector<std::string>& names = header_.label_schema.class_names;
  if (names == class_names) return;
  if (names.size() > class_names.size() ||
      !std::equal(names.begin(), names.end(), class_names.begin())) {
    throw InputError(fmt::format(
        "expected classes that begin with those of the shard, {}, got {}, in {}: make all shards "
        "again (eventgan convert --overwrite)",
        fmt::join(names, ", "), fmt::join(class_names, ", "), (folder_ / before_.shard).string()));
  }
  names = class_names;
  writer_ = std::make_unique<ShardWriter>(folder_, header_);
}

void ShardRewrite::redo(int slot, const SampleMessage& message) {
  for (std::size_t stage = 0; stage < kStageCount; ++stage) {
    record_.stage_seconds[kStageNames[stage]] += message.seconds[stage];
  }
  if (!is_news(slot, message.sample)) return;  // copied with the rest, if at all
  if (!writer_) writer_ = std::make_unique<ShardWriter>(folder_, header_);
  copy_before(slot);
  append(message.sample, message.chunk);
  if (message.sample.valid) mended_ += message.input_counts();
}

bool ShardRewrite::is_news(int slot, const ShardSample& sample) const {
  return sample.valid || sample.fault != reason_of(before_, slot) ||
         sample.annotation.original != reader_.sample(slot).annotation.original;
}

void ShardRewrite::copy_before(int slot) {
  while (record_.samples < slot) {
    ShardSample sample = reader_.sample(record_.samples);
    sample.fault = reason_of(before_, record_.samples);
    append(sample, reader_.stored_chunk(record_.samples));
  }
}

void ShardRewrite::append(const ShardSample& sample, std::span<const std::byte> chunk) {
  writer_->append(sample, chunk);
  if (sample.valid) {
    ++record_.valid;
  } else {
    record_.quarantined.push_back({record_.samples, sample.sample_id, sample.fault});
  }
  ++record_.samples;
}

bool ShardRewrite::commit() {
  if (!writer_) return false;
  copy_before(reader_.header().sample_count);
  const std::filesystem::path commit_record_file = folder_ / commit_record_name(record_.shard);
  if (parse_commit_record(read_text_file(commit_record_file), commit_record_file.string()).sha256 !=
      before_.sha256) {
    throw std::runtime_error("expected the shard that the retry started with, got another, in " +
                             (folder_ / record_.shard).string() + ": run retry again");
  }
  outdate_dataset(folder_, record_.shard);
  ShardBackup backup(folder_ / record_.shard);
  ShardReceipt receipt = writer_->commit();
  record_.sha256 = receipt.sha256;
  record_.size_bytes = receipt.size_bytes;
  record_.contents = std::move(receipt.contents);
  record_.inputs += mended_;
  const std::string text = to_json(record_);
  try {
    write_file_atomically(commit_record_file, text);
  } catch (const std::runtime_error&) {
    // The commit record may be in place all the same: its name is, only not known to be on disk.
    if (read_text_file(commit_record_file) == text) backup.release();
    throw;
  }
  backup.release();
  // That of a `finalize` which looked at the shard before it was replaced.
  outdate_dataset(folder_, record_.shard, record_.sha256);
  return true;
}

}  // namespace eventgan

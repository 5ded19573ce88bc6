#include "pipeline/conversion/shard_queue.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/plan.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/unfinished_files.h"
#include "pipeline/folder/shard_scan.h"

namespace eventgan {
namespace {

/// A listing is kept so many times as long as it took: folders of thousands of shards on network
/// file systems are slow to list.
constexpr int kListingStands = 20;

bool is_ours(const TemporaryName& name) {
  return name.pid == ::getpid() && name.host == host_name();
}

}  // namespace

SharedFolder::SharedFolder(std::filesystem::path folder, std::string plan_hash,
                           std::map<std::string, std::string> distrusted,
                           std::chrono::steady_clock::duration tell_interval)
    : folder_(std::move(folder)),
      plan_hash_(std::move(plan_hash)),
      distrusted_(std::move(distrusted)),
      tell_interval_(tell_interval),
      next_tell_(std::chrono::steady_clock::now() + tell_interval),
      next_listing_(std::chrono::steady_clock::now()) {}

SharedFolder::~SharedFolder() {
  for (const auto& [shard, claim] : claims_) end(claim);
}

ShardActivity SharedFolder::look_at(const PlannedShard& shard) {
  const std::lock_guard lock(mutex_);
  if (is_done(shard)) return ShardActivity::kDone;
  if (is_busy(shard)) return ShardActivity::kBusy;
  claim(shard);
  return ShardActivity::kFree;
}

void SharedFolder::tell(const PlannedShard& shard, int samples) {
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  const auto claim = claims_.find(shard.name);
  if (now < next_tell_ || claim == claims_.end()) return;
  next_tell_ = now + tell_interval_;
  const std::string text = std::to_string(samples);  // which only grows
  // A run does not end for a number that only `status` reads.
  (void)!::pwrite(claim->second.descriptor, text.data(), text.size(), 0);
}

void SharedFolder::release(const PlannedShard& shard) {
  const std::lock_guard lock(mutex_);
  const auto claim = claims_.find(shard.name);
  if (claim == claims_.end()) return;
  end(claim->second);
  claims_.erase(claim);
}

void SharedFolder::end(const Claim& claim) {
  ::close(claim.descriptor);
  std::error_code ignored;  // the next run cleans up what stays
  std::filesystem::remove(claim.file, ignored);
}

bool SharedFolder::is_done(const PlannedShard& shard) const {
  const auto distrusted = distrusted_.find(shard.name);
  if (distrusted == distrusted_.end()) {
    return shard_state(folder_, outline_of(shard), plan_hash_).done();
  }
  return shard_state(folder_, outline_of(shard), plan_hash_, ScanDepth::kBytes).done() &&
         read_text_file(folder_ / commit_record_name(shard.name)) != distrusted->second;
}

bool SharedFolder::is_busy(const PlannedShard& shard) {
  const auto start = std::chrono::steady_clock::now();
  if (start >= next_listing_) {
    busy_.clear();
    for (const UnfinishedFile& file : unfinished_files(folder_)) {
      if (!is_ours(file.name) && !is_stale(file)) busy_.insert(file.name.target);
    }
    const auto end = std::chrono::steady_clock::now();
    next_listing_ = end + kListingStands * (end - start);
  }
  return busy_.contains(shard.name) || busy_.contains(commit_record_name(shard.name));
}

void SharedFolder::claim(const PlannedShard& shard) {
  const std::filesystem::path file = temporary_beside(folder_ / shard.name);
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    throw std::runtime_error("cannot create " + file.string() + ": " + std::strerror(errno));
  }
  claims_[shard.name] = {file, descriptor};
}

ShardQueue::ShardQueue(std::vector<const PlannedShard*> shards, Look look)
    : shards_(shards.begin(), shards.end()), look_(std::move(look)) {}

const PlannedShard* ShardQueue::next(const std::function<bool()>& stop) {
  while (!shards_.empty()) {
    if (stop && stop()) return nullptr;
    const PlannedShard* shard = shards_.front();
    const ShardActivity activity = look_(*shard);
    shards_.pop_front();
    if (activity == ShardActivity::kFree) return shard;
    if (activity == ShardActivity::kDone) done_by_others_.push_back(shard);
    if (activity == ShardActivity::kBusy) deferred_.push_back(shard);
  }
  return next_deferred(stop);
}

const PlannedShard* ShardQueue::next_deferred(const std::function<bool()>& stop) {
  for (auto at = deferred_.begin(); at != deferred_.end();) {
    if (stop && stop()) return nullptr;
    const PlannedShard* shard = *at;
    const ShardActivity activity = look_(*shard);
    if (activity == ShardActivity::kBusy) {
      ++at;
      continue;
    }
    at = deferred_.erase(at);
    if (activity == ShardActivity::kFree) return shard;
    done_by_others_.push_back(shard);
  }
  if (deferred_.empty()) return nullptr;
  // Rather one shard made twice than one waited for: its writer may be dead without a sign.
  const PlannedShard* shard = deferred_.front();
  deferred_.pop_front();
  return shard;
}

}  // namespace eventgan

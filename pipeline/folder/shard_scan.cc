#include "pipeline/folder/shard_scan.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "pipeline/runtime/threads.h"
#include "stages/shards/shard_check.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A commit record that does not parse may be wrong in many places; the first says enough.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

/// One look at one shard.
class Look {
 public:
  Look(const fs::path& folder, const ShardOutline& shard, const std::string& plan_hash)
      : plan_hash_(plan_hash),
        shard_file_(folder / shard.name),
        commit_record_file_(folder / commit_record_name(shard.name)) {
    state_.outline = shard;
  }

  ShardState run(ScanDepth depth) && {
    look_at_names();
    if (depth == ScanDepth::kContents) {
      if (state_.done()) state_.faults = check_shard(shard_file_, *state_.record);
      return std::move(state_);
    }
    if (state_.done() && depth >= ScanDepth::kBytes) hash();
    if (state_.done() && depth >= ScanDepth::kRows) compare_rows();
    return std::move(state_);
  }

 private:
  void fail(ShardCondition condition, std::string fault) {
    state_.condition = condition;
    state_.record.reset();
    state_.faults = {std::move(fault)};
  }

  void fail(ShardCondition condition, const fs::path& path, const std::string& what) {
    fail(condition, path.string() + ": " + what);
  }

  void look_at_names() {
    std::error_code unreadable;
    if (!fs::exists(commit_record_file_, unreadable) && !unreadable) {
      if (!fs::exists(shard_file_, unreadable) && !unreadable) return;  // missing
      return fail(ShardCondition::kUncommitted, shard_file_,
                  "expected its commit record " + commit_record_file_.filename().string() +
                      " beside it, got no file (not committed)");
    }
    read_commit_record();
    if (!state_.done()) return;
    if (!fs::is_regular_file(shard_file_, unreadable)) {
      return fail(
          ShardCondition::kNoShard, shard_file_,
          "expected the shard of " + commit_record_file_.filename().string() + ", got no file");
    }
    const auto size_bytes = static_cast<std::int64_t>(fs::file_size(shard_file_, unreadable));
    if (unreadable || size_bytes != state_.record->size_bytes) {
      fail(ShardCondition::kOtherSize, shard_file_,
           "expected size in bytes " + std::to_string(state_.record->size_bytes) + ", got " +
               (unreadable ? unreadable.message() : std::to_string(size_bytes)));
    }
  }

  /// Done, if the commit record says nothing against the plan.
  void read_commit_record() {
    try {
      state_.record =
          parse_commit_record(read_text_file(commit_record_file_), commit_record_file_.string());
    } catch (const std::runtime_error& error) {
      return fail(ShardCondition::kDamagedRecord, first_line(error.what()));
    }
    const CommitRecord& record = *state_.record;
    const auto foreign = [&](const std::string& expected, const std::string& got) {
      fail(ShardCondition::kForeignRecord, commit_record_file_,
           "expected the commit record of " + expected + ", got one of " + got);
    };
    state_.named_plan = record.plan_hash;
    if (record.shard != state_.outline.name) return foreign(state_.outline.name, record.shard);
    if (record.plan_hash != plan_hash_) {
      return foreign("plan " + plan_hash_, "plan " + record.plan_hash);
    }
    if (record.samples != state_.outline.samples) {
      return foreign(std::to_string(state_.outline.samples) + " samples",
                     std::to_string(record.samples) + " samples");
    }
    state_.condition = ShardCondition::kDone;
    std::error_code unknown;
    const auto committed = fs::last_write_time(commit_record_file_, unknown);
    if (!unknown) state_.committed = committed;
  }

  void hash() {
    std::string got;
    try {
      got = sha256_of_file(shard_file_);
    } catch (const std::runtime_error& error) {
      got = error.what();
    }
    if (got == state_.record->sha256) return;
    fail(ShardCondition::kOtherBytes, shard_file_,
         "expected SHA-256 " + state_.record->sha256 + ", got " + got);
  }

  void compare_rows() {
    try {
      const std::vector<std::string> faults = count_faults(shard_file_, *state_.record);
      if (!faults.empty()) fail(ShardCondition::kOtherCounts, commit_record_file_, faults.front());
    } catch (const std::runtime_error& error) {  // not std::bad_alloc: that is not of the shard
      fail(ShardCondition::kOtherCounts, commit_record_file_,
           "expected the commit record of a readable shard, got one whose " +
               first_line(error.what()));
    }
  }

  const std::string& plan_hash_;
  fs::path shard_file_;
  fs::path commit_record_file_;
  ShardState state_;
};

ProgressUnit phase_of(ScanDepth depth) {
  switch (depth) {
    case ScanDepth::kRecord:
      return {"shards", /*has_bytes=*/false, "checking"};
    case ScanDepth::kBytes:
    case ScanDepth::kRows:
      return {"shards", /*has_bytes=*/true, "hashing"};
    case ScanDepth::kContents:
      return {"shards", /*has_bytes=*/true, "verifying"};
  }
  return {};
}

/// Looks at those of `states` for which `which` is true.
template <class Which>
void look_at(const fs::path& folder, const std::string& plan_hash, ScanDepth depth,
             const ScanOptions& options, std::vector<ShardState>& states, const Which& which) {
  constexpr int kLooksAtOnce = 16;
  const bool is_read = depth != ScanDepth::kRecord;
  const int threads =
      options.threads == 0 && !is_read ? kLooksAtOnce : thread_count(options.threads);
  Phase phase(options.show_phase, phase_of(depth), std::ranges::count_if(states, which));
  for_each_index(states.size(), threads, [&](std::size_t i) {
    ShardState& state = states[i];
    if (!which(state)) return;
    TraceSpan span(is_read ? options.trace : nullptr, "hash earlier shard", "shard");
    span.note("shard", state.outline.name);
    if (state.record) span.note("bytes", state.record->size_bytes);
    const ShardOutline outline = std::move(state.outline);
    state = options.stop && options.stop() ? ShardState{.outline = outline}
                                           : shard_state(folder, outline, plan_hash, depth);
    phase.advance(state.record ? state.record->size_bytes : 0);
  });
}

}  // namespace

const char* to_string(ShardCondition condition) {
  switch (condition) {
    case ShardCondition::kDone:
      return "done";
    case ShardCondition::kMissing:
      return "missing";
    case ShardCondition::kUncommitted:
      return "not committed";
    case ShardCondition::kNoShard:
      return "commit record without shard";
    case ShardCondition::kDamagedRecord:
      return "damaged commit record";
    case ShardCondition::kForeignRecord:
      return "commit record of another plan or shard";
    case ShardCondition::kOtherSize:
      return "of another size";
    case ShardCondition::kOtherBytes:
      return "with other bytes";
    case ShardCondition::kOtherCounts:
      return "with other counts";
  }
  return "unknown";
}

ShardState shard_state(const fs::path& folder, const ShardOutline& shard,
                       const std::string& plan_hash, ScanDepth depth) {
  return Look(folder, shard, plan_hash).run(depth);
}

std::vector<std::string> notes_of(const PlanOutline& plan, const std::vector<ShardState>& shards) {
  InputCounts inputs;
  std::set<std::string> unknown = plan.unknown;
  for (const ShardState& shard : shards) {
    if (!shard.record) continue;
    inputs += shard.record->inputs;
    unknown.insert(shard.record->unknown.begin(), shard.record->unknown.end());
  }
  std::vector<std::string> notes = notes_of(plan.sources, unknown);
  std::ranges::copy(inputs.notes(), std::back_inserter(notes));
  return notes;
}

std::vector<ShardState> scan_shards(const fs::path& folder, const std::vector<ShardOutline>& shards,
                                    const std::string& plan_hash, ScanDepth depth,
                                    const ScanOptions& options) {
  std::vector<ShardState> states(shards.size());
  for (std::size_t i = 0; i < shards.size(); ++i) states[i].outline = shards[i];
  look_at(folder, plan_hash, depth, options, states, [](const ShardState&) { return true; });
  return states;
}

void scan_again(const fs::path& folder, const std::string& plan_hash, bool done,
                std::vector<ShardState>& states, ScanDepth depth, const ScanOptions& options) {
  look_at(folder, plan_hash, depth, options, states,
          [&](const ShardState& state) { return state.done() == done; });
}

std::vector<std::optional<std::vector<std::string>>> stored_classes(
    const std::filesystem::path& folder, const std::vector<ShardOutline>& shards,
    const std::string& plan_hash, std::size_t sources) {
  std::vector<std::optional<std::vector<std::string>>> names(sources);
  for (const ShardOutline& shard : shards) {
    auto& of_source = names.at(static_cast<std::size_t>(shard.source));
    if (of_source || !shard_state(folder, shard, plan_hash, ScanDepth::kBytes).done()) continue;
    try {
      of_source = ShardReader(folder / shard.name).header().label_schema.class_names;
    } catch (const std::runtime_error&) {  // damaged, whatever its record says: ask the next one
    }
  }
  return names;
}

}  // namespace eventgan

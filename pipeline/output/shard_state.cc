#include "pipeline/output/shard_state.h"

#include <cstdint>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "stages/files/sha256.h"
#include "stages/files/text_file.h"
#include "stages/shards/shard_check.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

ShardState faulty(ShardCondition condition, const fs::path& path, const std::string& what) {
  return {condition, std::nullopt, path.string() + ": " + what};
}

/// A marker that does not parse may be wrong in many places; the first says enough.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

ShardState without_marker(const fs::path& shard_file, const fs::path& marker_file) {
  std::error_code unreadable;
  if (!fs::exists(shard_file, unreadable) && !unreadable) return {};
  return faulty(ShardCondition::kUncommitted, shard_file,
                "expected its marker " + marker_file.filename().string() +
                    " beside it, got no file (not committed)");
}

/// What the marker says against the plan; done if nothing.
ShardState judged(const fs::path& marker_file, const ShardOutline& shard,
                  const std::string& plan_hash) {
  ShardMarker marker;
  try {
    marker = parse_marker(read_text_file(marker_file), marker_file.string());
  } catch (const std::runtime_error& error) {
    return {ShardCondition::kTornMarker, std::nullopt, first_line(error.what())};
  }
  const auto foreign = [&](const std::string& expected, const std::string& got) {
    return faulty(ShardCondition::kForeignMarker, marker_file,
                  "expected the marker of " + expected + ", got one of " + got);
  };
  if (marker.shard != shard.name) return foreign(shard.name, marker.shard);
  if (marker.plan_hash != plan_hash) {
    return foreign("plan " + plan_hash, "plan " + marker.plan_hash);
  }
  if (marker.samples != shard.samples) {
    return foreign(std::to_string(shard.samples) + " samples",
                   std::to_string(marker.samples) + " samples");
  }
  return {ShardCondition::kDone, std::move(marker), ""};
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
      return "marker without shard";
    case ShardCondition::kTornMarker:
      return "torn marker";
    case ShardCondition::kForeignMarker:
      return "foreign marker";
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
                       const std::string& plan_hash) {
  const fs::path shard_file = folder / shard.name;
  const fs::path marker_file = folder / marker_name(shard.name);
  std::error_code unreadable;
  if (!fs::exists(marker_file, unreadable) && !unreadable) {
    return without_marker(shard_file, marker_file);
  }
  ShardState state = judged(marker_file, shard, plan_hash);
  if (!state.done()) return state;
  if (!fs::is_regular_file(shard_file, unreadable)) {
    return faulty(
        ShardCondition::kNoShard, shard_file,
        "expected the shard that " + marker_file.filename().string() + " is of, got no file");
  }
  const auto size_bytes = static_cast<std::int64_t>(fs::file_size(shard_file, unreadable));
  if (unreadable || size_bytes != state.marker->size_bytes) {
    return faulty(ShardCondition::kOtherSize, shard_file,
                  "expected size in bytes " + std::to_string(state.marker->size_bytes) + ", got " +
                      (unreadable ? unreadable.message() : std::to_string(size_bytes)));
  }
  return state;
}

ShardState hashed_shard_state(const fs::path& folder, const ShardOutline& shard,
                              const std::string& plan_hash) {
  ShardState state = shard_state(folder, shard, plan_hash);
  if (!state.done()) return state;
  std::string got;
  try {
    got = sha256_of_file(folder / shard.name);
  } catch (const std::runtime_error& error) {
    got = error.what();
  }
  if (got == state.marker->sha256) return state;
  return faulty(ShardCondition::kOtherBytes, folder / shard.name,
                "expected SHA-256 " + state.marker->sha256 + ", got " + got);
}

ShardState proven_shard_state(const fs::path& folder, const ShardOutline& shard,
                              const std::string& plan_hash) {
  ShardState state = hashed_shard_state(folder, shard, plan_hash);
  if (!state.done()) return state;
  try {
    const std::vector<std::string> faults = count_faults(folder / shard.name, *state.marker);
    if (faults.empty()) return state;
    return faulty(ShardCondition::kOtherCounts, folder / marker_name(shard.name), faults.front());
  } catch (
      const std::runtime_error& error) {  // not std::bad_alloc, which says nothing of the shard
    return faulty(ShardCondition::kOtherCounts, folder / marker_name(shard.name),
                  "expected the marker of a shard that can be read, got one whose " +
                      first_line(error.what()));
  }
}

}  // namespace eventgan

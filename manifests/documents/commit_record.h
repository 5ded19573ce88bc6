#pragma once

#include <string>
#include <string_view>

#include "manifests/values/shard.h"

namespace eventgan {

/// Canonical JSON (sorted keys, two-space indent but an array of numbers on one line, newline at
/// the end). Throws std::invalid_argument for seconds that are negative or no number.
std::string to_json(const CommitRecord& record);

/// Throws std::runtime_error listing every fault ("PATH: $.key: expected X, got Y"); strict as
/// manifests are.
CommitRecord parse_commit_record(std::string_view text, const std::string& name);

/// Whether it is a shard's name as a plan gives it, NAME-SPLIT-00012-of-01024.h5: a file in the
/// document's own folder, and never one that is somebody else's.
bool is_shard_name(std::string_view name);
inline constexpr char kShardNameForm[] = "a shard's name, such as job-train-00012-of-01024.h5";

/// Name of the commit record that belongs to a shard file: the same name with ".h5" replaced by
/// ".json".
std::string commit_record_name(const std::string& shard_name);

}  // namespace eventgan

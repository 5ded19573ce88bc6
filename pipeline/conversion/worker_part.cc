#include "pipeline/conversion/worker_part.h"

#include <charconv>
#include <string_view>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

using Environment = std::function<const char*(const char*)>;

constexpr char kFlag[] = "--shards";
constexpr char kCount[] = "SHARD_COUNT";

[[noreturn]] void refuse(const std::string& what, const std::string& expected,
                         std::string_view value) {
  throw UsageError(what + ": expected " + expected + ", got \"" + std::string(value) + "\"");
}

/// A decimal number and nothing else; none if it is none or does not fit.
std::optional<int> number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

WorkerPart part_of_flag(const std::string& text) {
  if (text == "all") return {};
  const std::size_t slash = text.find('/');
  if (slash != text.npos) {
    const auto index = number(std::string_view(text).substr(0, slash));
    const auto count = number(std::string_view(text).substr(slash + 1));
    if (index && count && *index < *count) return {*index, *count, kFlag};
  }
  refuse(kFlag, "I/N with 0 <= I < N, or all", text);
}

int count_of_variable(const char* name, const Environment& environment) {
  const char* text = environment(name);
  if (text == nullptr) refuse(name, "the number of parts", "");
  const std::optional<int> count = number(text);
  if (!count || *count == 0) refuse(name, "a number of parts of 1 or more", text);
  return *count;
}

/// `count` = 0: any index will do.
WorkerPart part_of_variable(const char* name, int count, const Environment& environment) {
  const char* text = environment(name);
  const std::optional<int> index = number(text);
  if (!index) refuse(name, "a number of 0 or more", text);
  if (count > 0 && *index >= count) {
    refuse(name, "a part in 0.." + std::to_string(count - 1), text);
  }
  return {*index, count, name};
}

}  // namespace

WorkerPart choose_part(const std::optional<std::string>& flag, const Environment& environment) {
  if (flag) return part_of_flag(*flag);
  const bool counted = environment(kCount) != nullptr;
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    if (environment(name) == nullptr) continue;
    return part_of_variable(name, counted ? count_of_variable(kCount, environment) : 0,
                            environment);
  }
  if (counted) refuse("SHARD_INDEX", "this worker's part, since SHARD_COUNT is set", "");
  if (environment("OMPI_COMM_WORLD_RANK") != nullptr) {
    return part_of_variable("OMPI_COMM_WORLD_RANK",
                            count_of_variable("OMPI_COMM_WORLD_SIZE", environment), environment);
  }
  if (environment("SLURM_PROCID") != nullptr && environment("SLURM_STEP_NUM_TASKS") != nullptr) {
    return part_of_variable("SLURM_PROCID", count_of_variable("SLURM_STEP_NUM_TASKS", environment),
                            environment);
  }
  return {};
}

std::string to_text(const WorkerPart& part, int shard_count) {
  if (part.origin.empty()) return "all shards";
  return (part.count > 0 ? "part " : "shard ") + std::to_string(part.index) + " of " +
         std::to_string(part.count > 0 ? part.count : shard_count) + " (" + part.origin + ")";
}

}  // namespace eventgan

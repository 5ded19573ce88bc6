#include <map>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"
#include "pipeline/folder/status_text.h"

namespace eventgan {
namespace {

using nlohmann::json;

json number(const std::optional<double>& value) { return value ? json(*value) : json(); }

json writer_json(const UnfinishedFile& file) {
  return {{"host", file.name.host},
          {"pid", file.name.pid},
          {"silent_s", file.silent_s},
          {"writer", to_string(file.writer)}};
}

json running_json(const FolderStatus& status) {
  json list = json::array();
  for (const ShardAtWork& work : status.running) {
    list.push_back(writer_json(work.file));
    list.back()["shard"] = work.shard;
  }
  return list;
}

json left_over_json(const FolderStatus& status) {
  json list = json::array();
  for (const UnfinishedFile& file : status.left_over) {
    list.push_back(writer_json(file));
    list.back()["file"] = file.path.filename().string();
  }
  return list;
}

json quarantined_json(const FolderStatus& status) {
  json list = json::array();
  for (const QuarantinedSlot& sample : status.quarantined) {
    list.push_back({{"sample_id", sample.sample_id},
                    {"shard", sample.shard},
                    {"slot", sample.slot},
                    {"reason", sample.reason}});
  }
  return list;
}

}  // namespace

std::string status_json(const FolderStatus& status) {
  std::map<std::string, int> reasons;
  for (const QuarantinedSlot& sample : status.quarantined) ++reasons[fault_kind(sample.reason)];
  const json document = {{"folder", status.folder.string()},
                         {"plan_hash", status.plan_hash},
                         {"complete", status.complete()},
                         {"shards",
                          {{"planned", status.shards_planned},
                           {"done", status.shards_done},
                           {"running", status.shards_running},
                           {"missing", status.shards_missing()}}},
                         {"samples",
                          {{"planned", status.samples_planned},
                           {"written", status.samples_written},
                           {"quarantined", status.quarantined.size()}}},
                         {"running", running_json(status)},
                         {"left_over", left_over_json(status)},
                         {"damaged", status.damaged},
                         {"quarantined_by_reason", reasons},
                         {"quarantined", quarantined_json(status)},
                         {"notes", status.notes},
                         {"workers", status.writers},
                         {"pairs_per_second", number(status.pairs_per_second())},
                         {"seconds_left", number(status.seconds_left())}};
  return dump_json(document, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan

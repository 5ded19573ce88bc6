#include "manifests/documents/report.h"

namespace eventgan {
namespace {

bool says_nothing(const nlohmann::json& value) {
  return value.empty() || value == 0 || value == false || value == "";
}

}  // namespace

std::string text_of(const Report& report) {
  std::string text;
  for (const ReportRow& row : report) {
    if (row.text.empty() || (!row.key.empty() && says_nothing(row.value))) continue;
    text += row.text;
    if (!row.text.ends_with('\n')) text += '\n';
  }
  return text;
}

nlohmann::json json_of(const Report& report) {
  nlohmann::json json = nlohmann::json::object();
  for (const ReportRow& row : report) {
    if (!row.key.empty()) json[std::string(row.key)] = row.value;
  }
  return json;
}

std::string json_text_of(const Report& report, JsonLayout layout) {
  return dump_json(json_of(report), layout) + "\n";
}

void to_json(nlohmann::json& json, const QuarantinedSlot& sample) {
  json = {{"sample_id", sample.sample_id},
          {"shard", sample.shard},
          {"slot", sample.slot},
          {"reason", sample.reason}};
}

std::string listed(const std::vector<std::string>& items, const char* line) {
  return listed(items, std::ssize(items), "",
                [&](const std::string& item) { return fmt::format(fmt::runtime(line), item); });
}

}  // namespace eventgan

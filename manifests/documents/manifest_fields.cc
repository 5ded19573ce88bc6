#include "manifests/documents/manifest_fields.h"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/json_text.h"

namespace eventgan {
namespace {

void add_fields(const nlohmann::json& value, const std::string& path,
                std::map<std::string, std::string>& fields) {
  if (path == "$.errors" || path == "$.output.directory") return;
  if (value.is_object() && !value.empty()) {
    for (const auto& [key, member] : value.items()) add_fields(member, path + "." + key, fields);
  } else if (value.is_array() && !value.empty()) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      add_fields(value[i], path + "[" + std::to_string(i) + "]", fields);
    }
  } else {
    fields[path] = value.dump();
  }
}

}  // namespace

std::map<std::string, std::string> manifest_fields(std::string_view text) {
  FaultList faults("the manifest");
  const auto document = parse_json_text(text, faults);
  if (!document) throw std::runtime_error(faults.text());
  std::map<std::string, std::string> fields;
  add_fields(*document, "$", fields);
  return fields;
}

std::string to_json(const SensorSpec& spec) {
  return nlohmann::json(objects(list_sensor).json(spec)).dump();  // keys in the order of letters
}

}  // namespace eventgan

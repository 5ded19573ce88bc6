#include "tests/manifests/documents/json_schema.h"

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "tests/testing/text_file.h"

namespace eventgan::testing {
namespace {

using nlohmann::json;
using valijson::adapters::NlohmannJsonAdapter;

const valijson::Schema& parsed_schema(const std::string& name) {
  static std::map<std::string, std::unique_ptr<valijson::Schema>> schemas;
  auto& schema = schemas[name];
  if (!schema) {
    schema = std::make_unique<valijson::Schema>();
    valijson::SchemaParser(valijson::SchemaParser::kDraft7)
        .populateSchema(NlohmannJsonAdapter(schema_document(name)), *schema);
  }
  return *schema;
}

void find_open(const json& node, const std::string& place, std::string& found) {
  if (node.is_object() && node.value("type", json()) == "object") {
    if (node.value("additionalProperties", json()) != false) found += place + "\n";
    for (const auto& [name, property] : node.at("properties").items()) {
      const bool is_told = property.contains("description") || property.contains("const") ||
                           property.contains("$ref");
      if (!is_told) found += place + "/properties/" + name + "\n";
    }
  }
  if (!node.is_structured()) return;
  for (const auto& [key, child] : node.items()) find_open(child, place + "/" + key, found);
}

}  // namespace

const json& schema_document(const std::string& name) {
  static std::map<std::string, json> documents;
  const auto [found, is_new] = documents.try_emplace(name);
  if (is_new) {
    found->second = json::parse(
        read_file(std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "schemas" / name));
  }
  return found->second;
}

bool schema_accepts(const std::string& name, const json& document) {
  valijson::Validator validator(valijson::Validator::kStrongTypes);
  return validator.validate(parsed_schema(name), NlohmannJsonAdapter(document), nullptr);
}

json stated_default(const std::string& name, const std::string& pointer) {
  return schema_document(name).at(json::json_pointer(pointer + "/default"));
}

std::string open_or_undescribed(const std::string& name) {
  std::string found;
  find_open(schema_document(name), "#", found);
  return found;
}

json read_commented_json(const std::string& file) {
  const bool allow_exceptions = true, ignore_comments = true;
  return json::parse(read_file(file), nullptr, allow_exceptions, ignore_comments);
}

}  // namespace eventgan::testing

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace eventgan::testing {

/// One of the schemas in manifests/, e.g. "manifest.schema.json".
const nlohmann::json& schema_document(const std::string& name);

/// Whether the schema accepts the document; 9.0 and "9" are no integers here, as in the program.
bool schema_accepts(const std::string& name, const nlohmann::json& document);

/// A default that the schema states, by the JSON pointer of its property.
nlohmann::json stated_default(const std::string& name, const std::string& pointer);

/// Places of the schema where an object with properties is not closed, or a property not described.
std::string open_or_undescribed(const std::string& name);

/// A JSON file in which comments are allowed.
nlohmann::json read_commented_json(const std::string& file);

}  // namespace eventgan::testing

#pragma once

#include <map>
#include <string>

namespace eventgan {

/// The JSON Schemas (draft 7) of the documents that people write, by the names that they have in
/// manifests/schemas; made from the tables of the documents' fields (detail/fields.h).
std::map<std::string, std::string> document_schemas();

/// The page of all their keys, in Markdown, from the same tables: `eventgan help keys`.
std::string keys_page();

}  // namespace eventgan

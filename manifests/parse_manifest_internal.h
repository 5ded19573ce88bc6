#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Parses a manifest of type T, which has `text` and `directory`, with
/// `T read_document(const StrictValue&)`; throws UsageError with every fault found.
template <class T, class ReadDocument>
T parse_manifest(std::string_view text, const std::filesystem::path& directory,
                 const std::string& name, ReadDocument read_document) {
  T manifest;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults)) {
    manifest = read_document(StrictValue(*document, faults));
  }
  if (!faults.empty()) throw UsageError(faults.text());
  manifest.text = text;
  manifest.directory =
      directory.empty() ? std::filesystem::current_path() : std::filesystem::absolute(directory);
  return manifest;
}

}  // namespace eventgan

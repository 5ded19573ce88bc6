#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/documents/detail/fields.h"
#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"

namespace eventgan {

// What the manifests of conversion, training and simulation share.

/// Part of file names: 1..64 letters, digits, ".", "_", "-", the first neither "." nor "-".
bool is_name(std::string_view text);

/// A manifest file, byte for byte. Throws InputError if it cannot be read; `what` was expected
/// then.
std::string read_manifest_text(const std::filesystem::path& file,
                               std::string_view what = "a manifest");

/// Absolute folder that the relative paths of this manifest file start at.
std::filesystem::path manifest_folder(const std::filesystem::path& file);

/// Parses a manifest of type T, which has `text` and `directory`, by the table of its fields;
/// throws UsageError with every fault found.
template <class T>
T parse_manifest(std::string_view text, const std::filesystem::path& directory,
                 const std::string& name, void (*list)(Fields&, T&)) {
  T manifest;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults)) {
    objects(list).read(StrictValue(*document, faults), manifest);
  }
  if (!faults.empty()) throw UsageError(faults.text());
  manifest.text = text;
  manifest.directory =
      directory.empty() ? std::filesystem::current_path() : std::filesystem::absolute(directory);
  return manifest;
}

}  // namespace eventgan

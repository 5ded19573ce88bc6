#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/documents/detail/json_text.h"
#include "manifests/documents/detail/strict_json.h"
#include "manifests/values/faults.h"

namespace eventgan {

// What the manifests of conversion, training and simulation share.

/// A path: not empty, and without NUL, at which the file system would cut it.
std::string read_path(const StrictValue& value);

/// A part of file names: 1..64 letters, digits, ".", "_", "-", the first neither "." (hidden files
/// and temporaries) nor "-" (options of commands). Two of them, a number and a temporary's suffix
/// stay below the file systems' limit of 255 bytes.
std::string read_name(const StrictValue& value);
bool is_name(std::string_view text);

/// 0..2^63-1.
std::uint64_t read_seed(const StrictValue& value);

/// A manifest file, byte for byte. Throws InputError if it cannot be read; `what` was expected
/// then.
std::string read_manifest_text(const std::filesystem::path& file,
                               std::string_view what = "a manifest");

/// Absolute folder that the relative paths of this manifest file start at.
std::filesystem::path manifest_folder(const std::filesystem::path& file);

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

#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "manifests/documents/detail/fields.h"
#include "manifests/documents/detail/json_text.h"
#include "manifests/documents/detail/strict_json.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"

namespace eventgan {

// What the manifests of conversion, training and simulation share.

/// A path: not empty, and without NUL, at which the file system would cut it.
std::string read_path(const StrictValue& value);

/// A part of file names: 1..64 letters, digits, ".", "_", "-", the first neither "." (hidden files
/// and temporaries) nor "-" (options of commands). Two of them, a number and a temporary's suffix
/// stay below the file systems' limit of 255 bytes.
std::string read_name(const StrictValue& value);
bool is_name(std::string_view text);

/// Reads the keys of an object that only some of its kinds have: datasets, generators, formats.
template <class Kind>
class SpecialKeys {
 public:
  /// `what`: the key that says the kind; `kind`: none if it is faulty; then no key is out of place.
  SpecialKeys(StrictObject& object, const char* what, std::optional<Kind> kind)
      : object_(object), what_(what), kind_(kind) {}

  /// The key's value if it is there. It is a fault where the kind is not one of `owners`.
  template <class Kinds = std::initializer_list<Kind>>
  std::optional<StrictValue> find(std::string_view key, const Kinds& owners) {
    std::optional<StrictValue> value = object_.find(key);
    if (!value || !kind_ || std::ranges::find(owners, *kind_) != owners.end()) return value;
    const auto word = [](Kind owner) { return to_string(owner); };
    value->fault(fmt::format("no such key for {} \"{}\" (only for {})", what_, to_string(*kind_),
                             joined(owners, ", ", word)));
    return std::nullopt;
  }

  std::optional<std::string> find_path(std::string_view key, std::initializer_list<Kind> owners) {
    const std::optional<StrictValue> value = find(key, owners);
    return value ? std::optional(read_path(*value)) : std::nullopt;
  }

 private:
  StrictObject& object_;
  const char* what_;
  std::optional<Kind> kind_;
};

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

/// The same by the table of the manifest's fields.
template <class T>
T parse_manifest(std::string_view text, const std::filesystem::path& directory,
                 const std::string& name, void (*list)(Fields&, T&)) {
  return parse_manifest<T>(text, directory, name, [list](const StrictValue& document) {
    T manifest;
    objects(list).read(document, manifest);
    return manifest;
  });
}

}  // namespace eventgan

#pragma once

#include <filesystem>
#include <string>

namespace eventgan {

/// Where a manifest came from; every kind of manifest has it.
struct ManifestOrigin {
  std::string text;                 ///< the manifest file, byte for byte
  std::filesystem::path directory;  ///< absolute folder of the manifest; relative paths start here
};

/// `path` as the program must open it: below the manifest's folder unless it is absolute.
inline std::filesystem::path resolve(const ManifestOrigin& manifest, const std::string& path) {
  return manifest.directory / path;
}

}  // namespace eventgan

#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan::testing {

struct ZipMember {
  std::string name;
  std::string bytes;
  bool deflated = false;
};

/// Writes a zip file with libzip; members keep their order.
void write_zip(const std::filesystem::path& path, const std::vector<ZipMember>& members);

}  // namespace eventgan::testing

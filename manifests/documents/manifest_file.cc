#include "manifests/documents/detail/manifest_file.h"

#include <algorithm>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"

namespace eventgan {

std::string read_manifest_text(const std::filesystem::path& file, std::string_view what) {
  std::string reason;
  if (auto text = try_read_file(file, reason)) return *std::move(text);
  throw InputError("expected " + std::string(what) + ", got \"" + reason + "\", in " +
                   file.string());
}

std::filesystem::path manifest_folder(const std::filesystem::path& file) {
  return std::filesystem::absolute(file).parent_path();
}

bool is_name(std::string_view text) {
  const auto belongs = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  };
  return !text.empty() && text.size() <= 64 && text[0] != '.' && text[0] != '-' &&
         std::all_of(text.begin(), text.end(), belongs);
}

}  // namespace eventgan

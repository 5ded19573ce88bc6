#include "manifests/documents/detail/manifest_file.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>

#include "manifests/values/faults.h"

namespace eventgan {

std::string read_manifest_text(const std::filesystem::path& file, std::string_view what) {
  const auto fail = [&](const std::string& why) {
    throw InputError("expected " + std::string(what) + ", got \"" + why + "\", in " +
                     file.string());
  };
  std::error_code ignored;
  const auto status = std::filesystem::status(file, ignored);
  if (std::filesystem::is_directory(status)) fail("a folder");
  // A FIFO would wait for its writer, for ever perhaps.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    fail("not a regular file");
  }
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  if (stream && stream.peek() != std::ifstream::traits_type::eof()) text << stream.rdbuf();
  if (!stream.is_open() || stream.bad()) fail(std::generic_category().message(errno));
  return std::move(text).str();
}

std::filesystem::path manifest_folder(const std::filesystem::path& file) {
  return std::filesystem::absolute(file).parent_path();
}

std::string read_path(const StrictValue& value) {
  return value.text("a path", [](std::string_view text) {
    return !text.empty() && text.find('\0') == std::string_view::npos;
  });
}

bool is_name(std::string_view text) {
  const auto belongs = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  };
  return !text.empty() && text.size() <= 64 && text[0] != '.' && text[0] != '-' &&
         std::all_of(text.begin(), text.end(), belongs);
}

std::string read_name(const StrictValue& value) {
  return value.text(
      "1..64 letters, digits, \".\", \"_\" or \"-\", not beginning with \".\" or \"-\"", is_name);
}

std::uint64_t read_seed(const StrictValue& value) {
  return static_cast<std::uint64_t>(
      value.integer<std::int64_t>(0, std::numeric_limits<std::int64_t>::max()));
}

}  // namespace eventgan

#include <cerrno>
#include <fstream>
#include <sstream>
#include <system_error>

#include "manifests/faults.h"
#include "manifests/manifest_text_internal.h"

namespace eventgan {

std::string read_manifest_text(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw InputError("expected a manifest, got \"" + why + "\", in " + file.string());
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

}  // namespace eventgan

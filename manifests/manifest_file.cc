#include <cerrno>
#include <fstream>
#include <sstream>
#include <system_error>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"

namespace eventgan {

JobManifest read_job_manifest(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw InputError("expected a manifest, got \"" + why + "\", in " + file.string());
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) fail("a folder");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  if (stream && stream.peek() != std::ifstream::traits_type::eof()) text << stream.rdbuf();
  if (!stream.is_open() || stream.bad()) fail(std::generic_category().message(errno));
  return parse_job_manifest(text.view(), std::filesystem::absolute(file).parent_path(),
                            file.string());
}

}  // namespace eventgan

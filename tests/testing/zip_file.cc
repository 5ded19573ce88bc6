#include "tests/testing/zip_file.h"

#include <zip.h>

#include <stdexcept>

namespace eventgan::testing {

void write_zip(const std::filesystem::path& path, const std::vector<ZipMember>& members) {
  zip_t* archive = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  if (archive == nullptr) throw std::runtime_error("cannot create " + path.string());
  for (const ZipMember& member : members) {
    // libzip takes the bytes only when the archive is closed; `members` lives until then.
    zip_source_t* source =
        zip_source_buffer(archive, member.bytes.data(), member.bytes.size(), /*freep=*/0);
    const zip_int64_t index = zip_file_add(archive, member.name.c_str(), source, 0);
    const auto method = member.deflated ? ZIP_CM_DEFLATE : ZIP_CM_STORE;
    if (index < 0 ||
        zip_set_file_compression(archive, static_cast<zip_uint64_t>(index), method, 0) != 0) {
      throw std::runtime_error("cannot add " + member.name + " to " + path.string());
    }
  }
  if (zip_close(archive) != 0) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace eventgan::testing

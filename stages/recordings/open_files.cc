#include "stages/recordings/detail/open_files.h"

#include <sys/resource.h>

#include <algorithm>

#include "manifests/values/faults.h"

namespace eventgan {

RecentlyUsed& open_files() {
  static RecentlyUsed files([] {
    constexpr std::int64_t kFewest = 8, kMost = 1024;
    rlimit limit{};
    if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return kFewest;
    const auto open = static_cast<std::int64_t>(std::min<rlim_t>(limit.rlim_cur, 4 * kMost));
    return std::max(kFewest, open / 4);
  }());
  return files;
}

RecordingFile::RecordingFile(const std::filesystem::path& path)
    : name_(path.string()), file_([this, path] {
        InputFile file(path);
        if (end_byte_ >= 0 && file.end_byte() != end_byte_) {
          throw InputError("expected a file of " + std::to_string(end_byte_) +
                           " bytes as before, got " + std::to_string(file.end_byte()) + ", in " +
                           name_);
        }
        return file;
      }) {
  end_byte_ = file_.get()->end_byte();
}

}  // namespace eventgan

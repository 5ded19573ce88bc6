#include "stages/recordings/readers/detail/open_files.h"

#include "manifests/values/faults.h"

namespace eventgan {

OpenFiles& open_files() {
  constexpr std::size_t kMost = 1024;
  static OpenFiles files(static_cast<std::int64_t>(files_to_keep_open(kMost)));
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

void RecordingFile::refuse(const std::string& fault, std::int64_t byte) const {
  throw InputError(fault + ", in " + name_ + " (byte " + std::to_string(byte) + ")");
}

}  // namespace eventgan

#include "pipeline/training/training_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"

namespace eventgan {

namespace fs = std::filesystem;

namespace {

void require_own_folders(const TrainingFolder& folder) {
  for (const fs::path& below : {folder.checkpoints(), folder.images()}) {
    require_no_link(folder.root, below.filename());
  }
}

/// generator-12000.png, as TrainingFolder::image names them.
bool is_image(std::string_view name) {
  constexpr std::string_view kBegin = "generator-", kEnd = ".png";
  if (!name.starts_with(kBegin) || !name.ends_with(kEnd)) return false;
  name = name.substr(kBegin.size(), name.size() - kBegin.size() - kEnd.size());
  return !name.empty() && name.find_first_not_of("0123456789") == name.npos;
}

/// All that a training writes and removes, the checkpoints first: without them nothing goes on from
/// the rest.
std::vector<std::pair<fs::path, OwnFile>> files_of(const TrainingFolder& folder) {
  std::vector<std::pair<fs::path, OwnFile>> files;
  for (const char* name : {"latest", "previous", "next", "damaged"}) {
    files.emplace_back(folder.checkpoints() / (std::string(name) + ".safetensors"),
                       OwnFile::kCheckpoint);
  }
  files.insert(files.end(), {{folder.losses(), OwnFile::kTrainingTable},
                             {folder.curves(), OwnFile::kChart},
                             {folder.validation(), OwnFile::kValidationTable},
                             {folder.latest_weights(), OwnFile::kWeights},
                             {folder.weights(), OwnFile::kWeights}});
  return files;
}

}  // namespace

void TrainingFolder::require_own(bool overwrite) const {
  require_replaceable(lock(), OwnFile::kTrainingLock);
  fs::path result;
  bool has_checkpoints = false;
  const auto files = files_of(*this);
  // One of them may be damaged; it is a training's all the same beside another.
  for (const auto& [file, kind] : files) {
    has_checkpoints |=
        kind == OwnFile::kCheckpoint && fs::exists(file) && is_replaceable(file, kind);
  }
  for (const auto& [file, kind] : files) {
    if (kind != OwnFile::kCheckpoint || !has_checkpoints) require_replaceable(file, kind);
    if (fs::exists(file)) result = file;
  }
  if (overwrite || has_checkpoints || result.empty()) return;
  throw UsageError(
      "expected a training's checkpoints, or an empty folder, got results without "
      "checkpoints, in " +
      result.string() + " (--overwrite starts again; or choose another folder)");
}

void TrainingFolder::prepare() const {
  require_own_folders(*this);
  for (const fs::path& folder : {root, checkpoints(), images()}) {
    fs::create_directories(folder);
    remove_stale_temporaries(folder);
  }
}

void TrainingFolder::discard() const {
  require_own_folders(*this);
  // The checkpoints first: without them nothing goes on from the rest.
  for (const auto& [file, kind] : files_of(*this)) fs::remove(file);
  if (!fs::is_directory(images())) return;
  for (const auto& entry : fs::directory_iterator(images())) {
    if (is_image(entry.path().filename().string())) fs::remove(entry.path());
  }
}

namespace {

std::string holder_in(int descriptor) {
  std::array<char, 256> text{};
  const ssize_t length = ::pread(descriptor, text.data(), text.size(), 0);
  return length > 0 ? std::string(text.data(), static_cast<std::size_t>(length)) : "unknown";
}

/// For messages alone: a disk that is too full for it says so at the first checkpoint.
void write_holder(int descriptor) {
  const std::string holder = "process " + std::to_string(::getpid()) + " on " + host_name();
  if (::ftruncate(descriptor, 0) != 0) return;
  [[maybe_unused]] const ssize_t written = ::pwrite(descriptor, holder.data(), holder.size(), 0);
}

}  // namespace

TrainingLock::TrainingLock(const fs::path& folder) {
  fs::create_directories(folder);
  const fs::path file = TrainingFolder{folder}.lock();
  require_no_link(folder, file.filename());
  descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) {
    throw std::runtime_error("cannot create " + file.string() + ": " + std::strerror(errno));
  }
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) {
    write_holder(descriptor_);
  } else if (errno == EWOULDBLOCK) {
    const std::string holder = holder_in(descriptor_);
    ::close(descriptor_);
    throw std::runtime_error("expected an output folder that no other training writes to, got " +
                             holder + " at work, in " + folder.string());
  }
}

TrainingLock::~TrainingLock() { ::close(descriptor_); }

}  // namespace eventgan

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

#include "manifests/files/atomic_file.h"
#include "manifests/files/unfinished_files.h"

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

}  // namespace

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
  for (const fs::path& file :
       {checkpoints() / "latest.safetensors", checkpoints() / "previous.safetensors",
        checkpoints() / "next.safetensors", checkpoints() / "damaged.safetensors", losses(),
        curves(), validation(), latest_weights(), weights()}) {
    fs::remove(file);
  }
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

#include "pipeline/training/training_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include "stages/base/files/unfinished_files.h"

namespace eventgan {

namespace fs = std::filesystem;

void TrainingFolder::prepare() const {
  for (const fs::path& folder : {root, checkpoints(), pictures()}) {
    fs::create_directories(folder);
    remove_stale_temporaries(folder);
  }
}

void TrainingFolder::discard() const {
  // The checkpoints first: without them nothing goes on from the rest.
  for (const fs::path& file :
       {checkpoints() / "latest.safetensors", checkpoints() / "previous.safetensors",
        checkpoints() / "next.safetensors", checkpoints() / "damaged.safetensors", losses(),
        curves(), validation(), latest_weights(), weights()}) {
    fs::remove(file);
  }
  if (!fs::is_directory(pictures())) return;
  for (const auto& entry : fs::directory_iterator(pictures())) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("generator-") && name.ends_with(".png")) fs::remove(entry.path());
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
  const fs::path file = folder / "training.lock";
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

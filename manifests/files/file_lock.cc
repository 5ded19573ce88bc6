#include "manifests/files/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>

#include "manifests/files/atomic_file.h"

namespace eventgan {

FileLock::FileLock(const std::filesystem::path& path, IfTaken if_taken)
    : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0) throw_system_error("cannot open " + path.string(), errno);
  const int operation = if_taken == IfTaken::kWait ? LOCK_EX : LOCK_EX | LOCK_NB;
  int failed = 0;
  while ((failed = ::flock(descriptor_, operation)) != 0 && errno == EINTR) {
  }
  is_taken_ = failed != 0 && errno == EWOULDBLOCK;
}

FileLock::~FileLock() { ::close(descriptor_); }

}  // namespace eventgan

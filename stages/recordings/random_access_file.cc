#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "manifests/faults.h"
#include "stages/recordings/random_access_file_internal.h"

namespace eventgan {

RandomAccessFile::RandomAccessFile(const std::filesystem::path& path)
    : name_(path.string()), descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (descriptor_ < 0) {
    throw InputError("expected a readable file, got " + std::string(std::strerror(errno)) +
                     ", in " + name_);
  }
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor_);
    throw InputError("expected a file, got a folder or device, in " + name_);
  }
  size_bytes_ = status.st_size;
}

RandomAccessFile::~RandomAccessFile() { ::close(descriptor_); }

std::string RandomAccessFile::read(std::int64_t begin, std::int64_t end) const {
  std::string bytes(static_cast<std::size_t>(end - begin), '\0');
  std::size_t have = 0;
  while (have < bytes.size()) {
    const ssize_t got = ::pread(descriptor_, bytes.data() + have, bytes.size() - have,
                                static_cast<off_t>(begin) + static_cast<off_t>(have));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw InputError("expected readable bytes, got " +
                       std::string(got < 0 ? std::strerror(errno) : "a file that has shrunk") +
                       ", in " + name_);
    }
    have += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace eventgan

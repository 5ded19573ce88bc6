#include "stages/files/text_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace eventgan {

InputFile open_input(const std::filesystem::path& file, std::string& reason) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    reason = std::strerror(errno);
    return nullptr;
  }
  struct stat status {};
  const bool known = ::fstat(descriptor, &status) == 0;
  if (known && S_ISREG(status.st_mode)) {
    if (InputFile opened{::fdopen(descriptor, "rb")}) return opened;
  }
  reason = !known || S_ISREG(status.st_mode) ? std::strerror(errno)
           : S_ISDIR(status.st_mode)         ? std::strerror(EISDIR)
                                             : "Not a regular file";
  ::close(descriptor);
  return nullptr;
}

void require_regular_file(const std::filesystem::path& file) {
  std::string reason;
  if (!open_input(file, reason)) {
    throw std::runtime_error("expected a readable file, got '" + reason + "', in " + file.string());
  }
}

std::optional<std::string> try_read_file(const std::filesystem::path& file, std::string& reason) {
  const InputFile opened = open_input(file, reason);
  if (!opened) return std::nullopt;
  std::string bytes;
  std::array<char, 1 << 14> block;
  std::size_t count = 0;
  while ((count = std::fread(block.data(), 1, block.size(), opened.get())) > 0) {
    bytes.append(block.data(), count);
  }
  if (!std::ferror(opened.get())) return bytes;
  reason = std::strerror(errno);
  return std::nullopt;
}

std::string read_text_file(const std::filesystem::path& file) {
  std::string reason;
  if (auto bytes = try_read_file(file, reason)) return *std::move(bytes);
  throw std::runtime_error("cannot read " + file.string() + ": " + reason);
}

}  // namespace eventgan

#include "pipeline/output/hashed_file.h"

#include <cerrno>
#include <system_error>

namespace eventgan {

HashedFile::HashedFile(const std::filesystem::path& file)
    : path_(file), block_(std::size_t{1} << 20) {
  std::error_code unknown;
  // Opening a FIFO would wait for its writer, for ever perhaps.
  if (!std::filesystem::is_other(file, unknown)) file_.open(file, std::ios::binary);
}

HashedFile::int_type HashedFile::underflow() {
  file_.read(block_.data(), static_cast<std::streamsize>(block_.size()));
  const auto size = static_cast<std::size_t>(file_.gcount());
  if (file_.bad() || (size < block_.size() && !file_.eof())) {
    throw std::system_error(errno, std::generic_category(), "cannot read " + path_.string());
  }
  if (size == 0) return traits_type::eof();
  hash_.update(std::string_view(block_.data(), size));
  setg(block_.data(), block_.data(), block_.data() + size);
  return traits_type::to_int_type(block_.front());
}

}  // namespace eventgan

#include "stages/files/text_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <ios>
#include <iterator>
#include <stdexcept>

namespace eventgan {

std::string read_text_file(const std::filesystem::path& file) {
  errno = 0;
  try {
    std::ifstream stream(file, std::ios::binary);
    if (stream) return {std::istreambuf_iterator<char>(stream), {}};
  } catch (const std::ios_base::failure&) {  // an I/O error, or a folder
  }
  throw std::runtime_error("cannot read " + file.string() + ": " + std::strerror(errno));
}

}  // namespace eventgan

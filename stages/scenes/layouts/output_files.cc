#include "stages/scenes/layouts/output_files.h"

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "stages/base/files/atomic_file.h"

namespace eventgan {

std::string numbered(int number, int digits) {
  const std::string text = std::to_string(number);
  const auto width = static_cast<std::size_t>(digits);
  return std::string(width > text.size() ? width - text.size() : 0, '0') + text;
}

void write_text(const std::filesystem::path& path, std::string_view text) {
  std::ofstream stream(path, std::ios::binary);
  stream.write(text.data(), static_cast<std::streamsize>(text.size()));
  stream.close();
  if (!stream) throw_system_error("cannot write " + path.string(), errno);
}

void copy_output(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code error;
  std::filesystem::copy_file(from, to, error);
  if (error) {
    throw std::runtime_error("cannot copy " + from.string() + " to " + to.string() + ": " +
                             error.message());
  }
}

void make_folder(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw std::runtime_error("cannot make " + path.string() + ": " + error.message());
}

void write_moments(const std::function<Picture(double)>& picture, int first, int last, int between,
                   const std::filesystem::path& folder) {
  if (between == 0) return;
  make_folder(folder);
  for (int i = 0; i <= (last - first) * (between + 1); ++i) {
    write_png(picture(first + i / (between + 1.0)), folder / (numbered(i, 5) + ".png"));
  }
}

}  // namespace eventgan

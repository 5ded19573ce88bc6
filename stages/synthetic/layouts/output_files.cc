#include "stages/synthetic/layouts/output_files.h"

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "manifests/files/atomic_file.h"
#include "stages/base/images/image_file.h"

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

void write_png(const Image& image, const std::filesystem::path& path) {
  write_text(path, encode_png({image.size, image.bgr.data()}));
}

void write_jpeg(const Image& image, const std::filesystem::path& path) {
  write_text(path, encode_jpeg({image.size, image.bgr.data()}, 90));
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

void write_intermediate_frames(const std::function<Image(double)>& render, int first, int last,
                               int intermediate_count, const std::filesystem::path& folder) {
  if (intermediate_count == 0) return;
  make_folder(folder);
  for (int i = 0; i <= (last - first) * (intermediate_count + 1); ++i) {
    write_png(render(first + i / (intermediate_count + 1.0)), folder / (numbered(i, 5) + ".png"));
  }
}

}  // namespace eventgan

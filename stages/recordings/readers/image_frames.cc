#include "stages/recordings/readers/detail/image_frames.h"

#include <stdexcept>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/images/image_file.h"

namespace eventgan {
GreyImage grey_of(const ColourFrame& colour, bool& has_colour) {
  GreyImage grey{colour.size, std::vector<std::uint8_t>(colour.size.pixel_count())};
  for (std::size_t i = 0; i < grey.pixels.size(); ++i) {
    const std::uint8_t* const bgr = &colour.bgr[3 * i];
    has_colour |= bgr[0] != bgr[1] || bgr[1] != bgr[2];
    const int thousandths = 114 * bgr[0] + 587 * bgr[1] + 299 * bgr[2];
    grey.pixels[i] = static_cast<std::uint8_t>((thousandths + 500) / 1000);
  }
  return grey;
}

ImageFrames::ImageFrames(std::vector<std::filesystem::path> files, std::vector<double> times_s)
    : files_(std::move(files)), times_s_(std::move(times_s)), size_(read_any_size(0).size) {}

GreyImage ImageFrames::read(std::int64_t index) const {
  const auto position = static_cast<std::size_t>(index);
  GreyImage image = read_any_size(position);
  if (image.size == size_) return image;
  throw InputError("expected frames of one size, " + to_string(size_) + ", got " +
                   to_string(image.size) + ", in " + files_[position].string());
}

GreyImage ImageFrames::read_any_size(std::size_t index) const {
  const std::filesystem::path& file = files_[index];
  try {
    bool has_colour = false;
    GreyImage image = grey_of(decode_image_file(file), has_colour);
    std::ptrdiff_t none_yet = -1;
    if (has_colour)
      colour_frame_.compare_exchange_strong(none_yet, static_cast<std::ptrdiff_t>(index));
    return image;
  } catch (const std::runtime_error& error) {
    std::throw_with_nested(InputError(std::string(error.what()) + ", in " + file.string()));
  }
}

std::vector<std::string> ImageFrames::notes() const {
  const std::ptrdiff_t frame = colour_frame_;
  if (frame < 0) return {};
  return {"frames in colour are made grey, in " + files_[static_cast<std::size_t>(frame)].string()};
}

}  // namespace eventgan

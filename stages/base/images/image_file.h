#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A decoded colour image: [y, x, channel] uint8, C order, channels blue, green, red, 0..255.
struct ColourFrame {
  ImageSize size;
  std::vector<std::uint8_t> bgr;
};

/// The same, owned by somebody else.
struct ColourView {
  ImageSize size;
  const std::uint8_t* bgr = nullptr;
};

/// A colour image of 16 bits: [y, x, channel] uint16, C order, channels blue, green, red.
struct WideFrame {
  ImageSize size;
  std::vector<std::uint16_t> bgr;
};

/// An image whose values are numbers, as of objects: [y, x] uint16, C order.
struct IndexImage {
  ImageSize size;
  std::vector<std::uint16_t> indices;
  int bits = 8;              ///< of a pixel in the file: 1, 2, 4, 8 or 16
  bool has_palette = false;  ///< the numbers are those of colours
};

/// A header may announce any size; images beyond this many pixels are refused before memory is
/// taken for them.
inline constexpr std::size_t kMaxImagePixels = std::size_t{1} << 26;

/// Throws std::runtime_error ("a size of WxH, not 1 to N pixels") if the size is empty or beyond
/// the limit.
void check_image_size(ImageSize size);

/// The file, open. Throws std::runtime_error "expected a readable file, got 'REASON'", without the
/// file's name, as all of these do.
InputFile open_image_file(const std::filesystem::path& file);

/// True if the file is an image by its first bytes, whatever its name. Throws std::runtime_error
/// "expected an image, got an empty file". Thread safe.
bool is_image(const InputFile& file);

/// How an image is taken: as it is stored, or turned as its orientation says (EXIF 2.32, tag
/// 0x0112), which cameras write that were held upright.
enum class ImageOrientation { kStored, kUpright };

/// Decodes a JPEG, PNG, WebP, TIFF, BMP or PNM file, told by its first bytes, strictly
/// (image_codecs.h). Throws std::runtime_error saying what is wrong ("expected a whole PNG, got
/// ..."). Thread safe.
///
/// Upright, orientations 3, 6 and 8 are turned by 180, 90 and 270 degrees clockwise. Those that
/// mirror (2, 4, 5, 7) throw too, "expected an image that is not mirrored, got EXIF orientation 2":
/// one that was drawn from the other side is no other view of the scene. A file that tells none, or
/// a number beyond 1 to 8, is taken as stored, as all do.
///
/// Of an image of 16 bits (PNG, TIFF, PNM) the upper 8 are taken, or with a `range` the value v
/// becomes round(255 (v - low) / (high - low)), at least 0 and at most 255. Others have no use for
/// the range.
///
/// `reduced_by` 2, 4 or 8: a JPEG whose sides are multiples of it is decoded to that part of its
/// size (decode_reduced_jpeg), which takes a fraction of the time; all else whole.
ColourFrame decode_image(const InputFile& file, ImageOrientation orientation,
                         const std::optional<ValueRange>& range = {}, int reduced_by = 1);
ColourFrame decode_image_file(const std::filesystem::path& file,
                              ImageOrientation orientation = ImageOrientation::kStored,
                              const std::optional<ValueRange>& range = {});

/// Decodes a PNG that is grey or has a palette, without looking up any colour. Throws as
/// decode_image, and so of colours. Thread safe.
IndexImage decode_index_image(const InputFile& file);

/// Decodes a PNG of red, green and blue in 16 bits each. Throws as decode_image, and so of others.
/// Thread safe.
WideFrame decode_wide_image(const InputFile& file);

/// Counts the values of an image of 16 bits: `histogram` has 65,536 counts. False, and nothing is
/// counted, if it has fewer bits. Throws as decode_image. Thread safe for different histograms.
bool count_wide_values(const InputFile& file, std::span<std::int64_t> histogram);

/// The size alone, from the header, turned as the image would be. Throws as above. Thread safe.
ImageSize image_size(const InputFile& file, ImageOrientation orientation);
ImageSize image_file_size(const std::filesystem::path& file,
                          ImageOrientation orientation = ImageOrientation::kStored);

/// The bytes of a PNG, or of a JPEG of a quality of 1 to 100. Throw std::runtime_error if the image
/// is empty or too large for the format. Thread safe. `is_drawn`: the PNG's text "Software" names
/// the program, so that it knows its own pictures again (OwnFile::kPicture).
std::string encode_png(const ColourView& image, bool is_drawn = false);
std::string encode_jpeg(const ColourView& image, int quality);

/// The bytes of a PNG of numbers [y, x], C order, as many as `size` has pixels: 8 bits with a
/// palette for people, if none is beyond 254, which is what masks of objects call nothing (255);
/// else 16 bits grey. Throws as encode_png. Thread safe.
std::string encode_index_png(ImageSize size, std::span<const std::uint16_t> indices);

/// The bytes of a PNG of 16 bits a channel, red, green, blue: [y, x, 3]. Throws as encode_png.
/// Thread safe.
std::string encode_wide_png(ImageSize size, std::span<const std::uint16_t> rgb);

}  // namespace eventgan

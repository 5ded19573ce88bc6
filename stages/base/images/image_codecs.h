#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

// One decoder for each format of image files. Each takes a file that is open at its start and gives
// the same pixels as OpenCV's imread: grey and palettes become colour, 16 bits become 8,
// transparency is dropped, and an orientation tag is not applied; but a PNM's values are of the
// greatest that its header tells, also in binary. And where OpenCV returns an image with a grey or
// invented rest, these throw std::runtime_error saying what is wrong if any pixel is missing or in
// doubt, as they do if the image is too large (check_image_size, before memory is taken) or of a
// kind that is not read. All are thread safe and write nothing to the standard streams. The sizes
// are from the header alone, and so are the orientations: 1 to 8 as EXIF counts, 1 where none is
// told.

/// Grey, YCbCr and RGB.
ColourFrame decode_jpeg(std::FILE* file);
/// 1/2, 1/4 or 1/8 of its size (`by` 2, 4, 8), if both sides are multiples of `by`, else whole: of
/// the lowest frequencies alone. At 1/8 a pixel is the mean of those it stands for; always it lies
/// in their middle.
ColourFrame decode_reduced_jpeg(std::FILE* file, int by);
ImageSize jpeg_size(std::FILE* file);
int jpeg_orientation(std::FILE* file);

/// Every PNG; 16 bits are cut to the upper 8. Throws also if a checksum of what decides the pixels
/// does not match, or a pixel is a colour that its palette does not have.
ColourFrame decode_png(std::FILE* file);
ImageSize png_size(std::FILE* file);
/// As strict; throws of colours without a palette, too. An index beyond the palette is one as well.
IndexImage decode_index_png(std::FILE* file);
/// By its chunk eXIf, wherever it stands.
int png_orientation(std::FILE* file);

/// One image, no animation. WebP has no checksum: changed bytes may be other pixels.
ColourFrame decode_webp(std::FILE* file);
ImageSize webp_size(std::FILE* file);
int webp_orientation(std::FILE* file);

/// The first page, if libtiff makes 8-bit colour of it: 16 bits are rounded, and a colour is
/// multiplied by its transparency unless it is so in the file. No floating point.
ColourFrame decode_tiff(std::FILE* file);
ImageSize tiff_size(std::FILE* file);
int tiff_orientation(std::FILE* file);

/// 1, 4, 8, 24 and 32 bits a pixel, not compressed.
ColourFrame decode_bmp(std::FILE* file);
ImageSize bmp_size(std::FILE* file);

/// PBM, PGM and PPM, plain and binary; 16 bits are cut to the upper 8.
ColourFrame decode_pnm(std::FILE* file);
ImageSize pnm_size(std::FILE* file);

/// The same images with all of their bits, if they have 16 a channel (PNM: more than 8); none
/// otherwise, from the header alone. As strict as above.
std::optional<WideFrame> decode_wide_png(std::FILE* file);
std::optional<WideFrame> decode_wide_tiff(std::FILE* file);
std::optional<WideFrame> decode_wide_pnm(std::FILE* file);

using Buffer = std::vector<std::uint8_t>;

/// The orientation in a block of EXIF, as it is in a file's metadata: "Exif", two NULs, a TIFF
/// header and its directories; 1 if it tells none. Thread safe.
int exif_orientation(const Buffer& block);

/// The image turned by 180 (3), 90 (6) or 270 degrees (8) clockwise, and the size of such a one; as
/// it is by 1. Thread safe.
ColourFrame turned(ColourFrame stored, int orientation);
ImageSize turned(ImageSize stored, int orientation);

/// The whole file, from its start, wherever it is open at; empty if it cannot be read, or has more
/// than `most` bytes. Thread safe.
Buffer whole_file(std::FILE* file, std::size_t most);

/// The pixels of a PNG: [y, x, sample], 8 or 16 bits a sample (big endian). The samples are grey,
/// red green blue, or a number in a palette, and alpha after the first two; a palette is [colour,
/// 3] uint8, red green blue.
struct PngPixels {
  ImageSize size;
  int samples = 0;  ///< 1 to 4
  int bits = 8;
  bool has_palette = false;
  Buffer palette;  ///< colours may suggest one, too
  Buffer rows;     ///< a byte in front of each row means nothing

  std::size_t pixel_bytes() const { return static_cast<std::size_t>(samples * bits / 8); }
  std::size_t row_bytes() const { return static_cast<std::size_t>(size.width) * pixel_bytes(); }
  std::span<std::uint8_t> row(int y) {
    return std::span(rows).subspan(static_cast<std::size_t>(y) * (1 + row_bytes()) + 1,
                                   row_bytes());
  }
};

/// Decodes a PNG from memory as a whole, which takes half of libpng's time or less: Debian's
/// inflates by zlib, and undoes the filters byte by byte.
///
/// Nothing if there is any doubt about the file, if its samples have fewer than 8 bits, or if it or
/// its pixels take more than 256 MiB: then libpng should read the file itself and judge it. Without
/// doubt means: a header of an image within kMaxImagePixels that is not interlaced, whole chunks up
/// to the end chunk, all pixel data in one run, no other chunk that decides the pixels but one
/// palette, every checksum (CRC-32 of each chunk that decides the pixels, Adler-32 of the pixel
/// data) right, and exactly as much data as the header says. Where the file is open at afterwards
/// is undefined. Thread safe.
std::optional<PngPixels> whole_png(std::FILE* file);

}  // namespace eventgan

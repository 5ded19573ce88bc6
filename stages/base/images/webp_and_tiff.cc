#include <tiffio.h>
#include <webp/decode.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "stages/base/images/image_codecs.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostWebpBytes = std::size_t{1} << 28;  // 4 for each pixel that there can be

/// Of the bytes at the start of a file.
ImageSize webp_header_size(const std::uint8_t* bytes, std::size_t count) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes, count, &features) != VP8_STATUS_OK) {
    throw std::runtime_error("a damaged header");
  }
  if (features.has_animation != 0) throw std::runtime_error("an animation");
  const ImageSize size{features.height, features.width};
  check_image_size(size);
  return size;
}

}  // namespace

ImageSize webp_size(std::FILE* file) {
  // Beyond the longest that stands before an image's own header, unless its file has metadata.
  std::array<std::uint8_t, 1 << 12> start;
  return webp_header_size(start.data(), std::fread(start.data(), 1, start.size(), file));
}

ColourFrame decode_webp(std::FILE* file) {
  webp_size(file);
  const Buffer bytes = whole_file(file, kMostWebpBytes);
  ColourFrame frame{webp_header_size(bytes.data(), bytes.size()), {}};
  frame.bgr.resize(3 * frame.size.pixel_count());
  if (WebPDecodeBGRInto(bytes.data(), bytes.size(), frame.bgr.data(), frame.bgr.size(),
                        3 * frame.size.width) == nullptr) {
    throw std::runtime_error("one that ends early or is damaged");
  }
  return frame;
}

namespace {

/// A TIFF whose complaints are kept, not told: the first that leaves a pixel in doubt.
class TiffFile {
 public:
  explicit TiffFile(std::FILE* file) {
    const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(
        TIFFOpenOptionsAlloc(), &TIFFOpenOptionsFree);
    if (options == nullptr) throw std::runtime_error("cannot start libtiff");
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), 8 * kMaxImagePixels);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_error, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), keep_warning, this);
    // Not mapped into memory ("m"): a file that is cut while it is read would end the program.
    tiff_ = TIFFClientOpenExt("", "rm", file, read_bytes, write_nothing, seek, keep_open,
                              size_bytes, nullptr, nullptr, options.get());
    if (tiff_ == nullptr) fail("a damaged header");
  }
  ~TiffFile() { TIFFClose(tiff_); }
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  ImageSize size() {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    TIFFGetField(tiff_, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(tiff_, TIFFTAG_IMAGELENGTH, &height);
    constexpr std::uint32_t kMost = kMaxImagePixels + 1;  // of either alone
    const ImageSize size{static_cast<int>(std::min(height, kMost)),
                         static_cast<int>(std::min(width, kMost))};
    check_image_size(size);
    return size;
  }

  int orientation() {
    std::uint16_t orientation = 1;
    TIFFGetField(tiff_, TIFFTAG_ORIENTATION, &orientation);
    return orientation >= 1 && orientation <= 8 ? orientation : 1;
  }

  ColourFrame read() {
    ColourFrame frame{size(), {}};
    char reason[1024] = "";
    TIFFRGBAImage image{};
    if (TIFFRGBAImageOK(tiff_, reason) == 0 ||
        TIFFRGBAImageBegin(&image, tiff_, /*stop=*/1, reason) == 0) {
      fail(reason);
    }
    image.req_orientation = image.orientation;  // as stored
    const std::size_t pixels = frame.size.pixel_count();
    const auto raster = std::make_unique_for_overwrite<std::uint32_t[]>(pixels);
    in_pixels_ = true;
    const int read = TIFFRGBAImageGet(&image, raster.get(), image.width, image.height);
    TIFFRGBAImageEnd(&image);
    if (read == 0 || !error_.empty()) fail("damaged pixels");
    frame.bgr.resize(3 * pixels);
    std::uint8_t* to = frame.bgr.data();
    for (const std::uint32_t pixel : std::span(raster.get(), pixels)) {
      *to++ = TIFFGetB(pixel);
      *to++ = TIFFGetG(pixel);
      *to++ = TIFFGetR(pixel);
    }
    return frame;
  }

  std::optional<WideFrame> read_wide() {
    WideFrame frame{size(), {}};
    const auto field = [this](std::uint32_t tag) {
      std::uint16_t value = 0;
      TIFFGetFieldDefaulted(tiff_, tag, &value);
      return value;
    };
    if (field(TIFFTAG_BITSPERSAMPLE) != 16) return std::nullopt;
    const int samples = field(TIFFTAG_SAMPLESPERPIXEL);
    const int kind = field(TIFFTAG_PHOTOMETRIC);
    const bool is_grey = kind == PHOTOMETRIC_MINISBLACK && samples <= 2;
    if (!is_grey && !(kind == PHOTOMETRIC_RGB && samples >= 3)) {
      fail("16 bits that are neither grey nor red, green, blue");
    }
    if (field(TIFFTAG_SAMPLEFORMAT) != SAMPLEFORMAT_UINT) fail("16 bits of signed or real numbers");
    if (field(TIFFTAG_PLANARCONFIG) != PLANARCONFIG_CONTIG || TIFFIsTiled(tiff_) != 0) {
      fail("16 bits in planes or tiles");
    }
    const auto width = static_cast<std::size_t>(frame.size.width);
    std::vector<std::uint16_t> row(width * static_cast<std::size_t>(samples));
    if (TIFFScanlineSize64(tiff_) != 2 * row.size()) fail("a damaged header");
    frame.bgr.reserve(3 * frame.size.pixel_count());
    in_pixels_ = true;
    for (int y = 0; y < frame.size.height; ++y) {
      if (TIFFReadScanline(tiff_, row.data(), static_cast<std::uint32_t>(y)) != 1 ||
          !error_.empty()) {
        fail("damaged pixels");
      }
      for (std::size_t x = 0; x < row.size(); x += static_cast<std::size_t>(samples)) {
        for (const std::size_t channel : {2, 1, 0}) {
          frame.bgr.push_back(row[x + (is_grey ? 0 : channel)]);
        }
      }
    }
    return frame;
  }

 private:
  [[noreturn]] void fail(const std::string& otherwise) const {
    throw std::runtime_error(error_.empty() ? otherwise : error_);
  }

  static tmsize_t read_bytes(void* file, void* to, tmsize_t count) {
    return static_cast<tmsize_t>(
        std::fread(to, 1, static_cast<std::size_t>(count), static_cast<std::FILE*>(file)));
  }
  static tmsize_t write_nothing(void*, void*, tmsize_t) { return 0; }
  static toff_t seek(void* file, toff_t to, int from) {
    auto* const stream = static_cast<std::FILE*>(file);
    const bool done = fseeko(stream, static_cast<off_t>(to), from) == 0;
    return done ? static_cast<toff_t>(ftello(stream)) : static_cast<toff_t>(-1);
  }
  static int keep_open(void*) { return 0; }
  /// libtiff moves to where it reads before each reading.
  static toff_t size_bytes(void* file) { return seek(file, 0, SEEK_END); }

  static int keep_error(TIFF*, void* file, const char*, const char* format, std::va_list values) {
    auto& error = static_cast<TiffFile*>(file)->error_;
    std::array<char, 256> text;
    std::vsnprintf(text.data(), text.size(), format, values);
    if (error.empty()) error = text.data();
    return 1;  // nobody else is told
  }
  /// libtiff warns of a tag that it does not know, but also of codes that make no pixels.
  static int keep_warning(TIFF* tiff, void* file, const char* module, const char* format,
                          std::va_list values) {
    if (!static_cast<TiffFile*>(file)->in_pixels_) return 1;
    return keep_error(tiff, file, module, format, values);
  }

  TIFF* tiff_ = nullptr;
  bool in_pixels_ = false;
  std::string error_;
};

}  // namespace

ImageSize tiff_size(std::FILE* file) { return TiffFile(file).size(); }

int tiff_orientation(std::FILE* file) { return TiffFile(file).orientation(); }

ColourFrame decode_tiff(std::FILE* file) { return TiffFile(file).read(); }

std::optional<WideFrame> decode_wide_tiff(std::FILE* file) { return TiffFile(file).read_wide(); }

}  // namespace eventgan

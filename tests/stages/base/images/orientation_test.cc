// Images that are turned as their EXIF orientation says.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <string>

#include "stages/base/images/image_codecs.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using testing::gradient_image;
using ::testing::HasSubstr;
using testing::opencv_read;
using testing::read_file;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::write_file;

/// A number's bytes, the lowest first or last.
std::string number_bytes(std::uint32_t value, int count, bool lowest_first) {
  std::string bytes;
  for (int i = 0; i < count; ++i) {
    const int shift = 8 * (lowest_first ? i : count - 1 - i);
    bytes += static_cast<char>(value >> shift & 0xff);
  }
  return bytes;
}

/// A TIFF header and a directory at byte 8 of one entry: tag 0x0112 (orientation), of type 3
/// (short), one of them.
std::string exif_of(int orientation, bool lowest_first) {
  const auto number = [&](std::uint32_t value, int count) {
    return number_bytes(value, count, lowest_first);
  };
  return (lowest_first ? "II" : "MM") + number(42, 2) + number(8, 4) + number(1, 2) +
         number(0x0112, 2) + number(3, 2) + number(1, 4) +
         number(static_cast<std::uint32_t>(orientation), 2) + number(0, 2) + number(0, 4);
}

std::string in_jpeg(const std::string& jpeg, const std::string& exif) {
  const auto size = static_cast<std::uint32_t>(exif.size() + 8);
  return jpeg.substr(0, 2) + "\xff\xe1" + number_bytes(size, 2, false) + "Exif\0\0"s + exif +
         jpeg.substr(2);
}

std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string checked = type + data;
  const auto checksum =
      crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size()));
  return number_bytes(static_cast<std::uint32_t>(data.size()), 4, false) + checked +
         number_bytes(static_cast<std::uint32_t>(checksum), 4, false);
}

constexpr std::size_t kPngHeader = 8 + 25;  // signature and IHDR
constexpr std::size_t kPngEnd = 12;

std::string in_png(const std::string& png, const std::string& exif, bool behind_pixels) {
  const std::size_t place = behind_pixels ? png.size() - kPngEnd : kPngHeader;
  return png.substr(0, place) + png_chunk("eXIf", exif) + png.substr(place);
}

/// An extended file (VP8X with its flag of EXIF) around the image of a simple one.
std::string in_webp(const std::string& webp, const std::string& exif, ImageSize size) {
  const auto chunk = [](const std::string& type, const std::string& data) {
    return type + number_bytes(static_cast<std::uint32_t>(data.size()), 4, true) + data +
           std::string(data.size() % 2, '\0');
  };
  const auto side = [](int pixels) {
    return number_bytes(static_cast<std::uint32_t>(pixels - 1), 3, true);
  };
  const std::string chunks = "WEBP" +
                             chunk("VP8X", "\x08\0\0\0"s + side(size.width) + side(size.height)) +
                             webp.substr(12) + chunk("EXIF", exif);
  return "RIFF" + number_bytes(static_cast<std::uint32_t>(chunks.size()), 4, true) + chunks;
}

/// By EXIF 2.32, table of tag Orientation: "the 0th row is at the visual right-hand side ..., the
/// 0th column is the visual top" (6), and so on.
cv::Mat turned_by_opencv(const cv::Mat& stored, int orientation) {
  cv::Mat upright = stored.clone();
  if (orientation == 3) cv::rotate(stored, upright, cv::ROTATE_180);
  if (orientation == 6) cv::rotate(stored, upright, cv::ROTATE_90_CLOCKWISE);
  if (orientation == 8) cv::rotate(stored, upright, cv::ROTATE_90_COUNTERCLOCKWISE);
  return upright;
}

std::string why_not_upright(const std::filesystem::path& file) try {
  decode_image_file(file, ImageOrientation::kUpright);
  image_file_size(file, ImageOrientation::kUpright);
  return "";
} catch (const std::runtime_error& error) {
  return error.what();
}

class ImageOrientationTest : public ::testing::Test {
 protected:
  /// A file of one orientation by its format's name; `stored` is what it is written of.
  std::string file_bytes(const std::string& ending, const std::string& exif) {
    const auto file = folder_ / ("plain." + ending);
    cv::imwrite(file.string(), gradient_image(kSize), {cv::IMWRITE_WEBP_QUALITY, 101});
    const std::string plain = read_file(file);
    if (ending == "jpg") return in_jpeg(plain, exif);
    if (ending == "png") return in_png(plain, exif, /*behind_pixels=*/false);
    return in_webp(plain, exif, kSize);
  }

  static constexpr ImageSize kSize{24, 40};
  TemporaryFolder folder_;
};

TEST_F(ImageOrientationTest, IsAppliedOrRefused) {
  for (const std::string ending : {"jpg", "png", "webp"}) {
    for (const bool lowest_first : {true, false}) {
      for (int orientation = 0; orientation <= 9; ++orientation) {
        const auto file = folder_ / ("image." + ending);
        write_file(file, file_bytes(ending, exif_of(orientation, lowest_first)));
        const std::string what = ending + " " + std::to_string(orientation);
        const cv::Mat stored = opencv_read(file);
        ASSERT_EQ(stored.rows, kSize.height) << what;
        EXPECT_TRUE(same_pixels(decode_image_file(file), stored)) << what;
        EXPECT_EQ(image_file_size(file), kSize) << what;
        if (orientation == 2 || orientation == 4 || orientation == 5 || orientation == 7) {
          EXPECT_EQ(why_not_upright(file),
                    "expected an image that is not mirrored, got EXIF "
                    "orientation " +
                        std::to_string(orientation));
          EXPECT_THROWS(image_file_size(file, ImageOrientation::kUpright), std::runtime_error,
                        "expected an image that is not mirrored, got EXIF");
          continue;
        }
        const cv::Mat upright = turned_by_opencv(stored, orientation);
        const ColourFrame frame = decode_image_file(file, ImageOrientation::kUpright);
        EXPECT_TRUE(same_pixels(frame, upright)) << what;
        EXPECT_EQ(image_file_size(file, ImageOrientation::kUpright), frame.size) << what;
        if (ending == "jpg") {  // OpenCV's own reading of the tag
          EXPECT_TRUE(same_pixels(frame, cv::imread(file.string()))) << what;
        }
      }
    }
  }
}

TEST_F(ImageOrientationTest, OfTiffIsItsOwnTag) {
  cv::imwrite((folder_ / "a.tiff").string(), gradient_image(kSize),
              {cv::IMWRITE_TIFF_COMPRESSION, 1});
  const std::string plain = read_file(folder_ / "a.tiff");
  // OpenCV writes no orientation: in place of its rows per strip (0x0116), which then are all rows.
  const std::size_t entry = plain.find("\x16\x01\x03\x00\x01\x00\x00\x00"s);
  ASSERT_NE(entry, std::string::npos);
  for (const int orientation : {1, 3, 6, 8}) {
    std::string bytes = plain;
    bytes[entry] = '\x12';
    bytes[entry + 8] = static_cast<char>(orientation);
    bytes[entry + 9] = 0;
    const auto file = folder_ / "b.tiff";
    write_file(file, bytes);
    const cv::Mat stored = gradient_image(kSize);
    EXPECT_TRUE(same_pixels(decode_image_file(file), stored)) << orientation;
    const ColourFrame frame = decode_image_file(file, ImageOrientation::kUpright);
    EXPECT_TRUE(same_pixels(frame, turned_by_opencv(stored, orientation))) << orientation;
    EXPECT_EQ(image_file_size(file, ImageOrientation::kUpright), frame.size);
  }
}

TEST_F(ImageOrientationTest, IsNoneWhereNoneIsTold) {
  const auto file = folder_ / "image";
  const auto size_of = [&](const std::string& bytes) {
    write_file(file, bytes);
    return image_file_size(file, ImageOrientation::kUpright);
  };
  const std::string six = exif_of(6, true);
  std::string as_long = six;
  as_long[12] = 4;  // a long, which it may not be
  std::string other_tag = six;
  other_tag[10] = 0x13;
  for (const std::string& exif : {""s, "II"s, "nonsense, nonsense"s, six.substr(0, 12),
                                  std::string(64, '\xff'), as_long, other_tag}) {
    for (const char* ending : {"jpg", "png", "webp"}) {
      EXPECT_EQ(size_of(file_bytes(ending, exif)), kSize) << ending << ' ' << exif;
    }
  }
  for (const char* ending : {"bmp", "ppm"}) {
    const auto plain = folder_ / ("plain."s + ending);
    cv::imwrite(plain.string(), gradient_image(kSize));
    EXPECT_EQ(image_file_size(plain, ImageOrientation::kUpright), kSize);
  }
}

TEST_F(ImageOrientationTest, IsFoundWhereverItStands) {
  const auto file = folder_ / "image";
  const ImageSize lying{kSize.width, kSize.height};
  const std::string six = exif_of(6, false);
  cv::imwrite((folder_ / "a.png").string(), gradient_image(kSize));
  const std::string png = read_file(folder_ / "a.png");
  write_file(file, in_png(png, six, /*behind_pixels=*/true));
  EXPECT_EQ(image_file_size(file, ImageOrientation::kUpright), lying);
  EXPECT_EQ(decode_image_file(file, ImageOrientation::kUpright).size, lying);
  // Behind other metadata of the same marker.
  cv::imwrite((folder_ / "a.jpg").string(), gradient_image(kSize));
  const std::string jpeg = in_jpeg(read_file(folder_ / "a.jpg"), six);
  const std::string other = "http://ns.adobe.com/xap/1.0/\0 more"s;
  write_file(file, jpeg.substr(0, 2) + "\xff\xe1" +
                       number_bytes(static_cast<std::uint32_t>(other.size() + 2), 2, false) +
                       other + jpeg.substr(2));
  EXPECT_EQ(image_file_size(file, ImageOrientation::kUpright), lying);
  // Some write JPEG's name of it into a WebP.
  write_file(file, file_bytes("webp", "Exif\0\0"s + six));
  EXPECT_EQ(image_file_size(file, ImageOrientation::kUpright), lying);
}

TEST_F(ImageOrientationTest, DamageIsNamed) {
  cv::imwrite((folder_ / "a.png").string(), gradient_image(kSize));
  const std::string png = in_png(read_file(folder_ / "a.png"), exif_of(6, true), false);
  const auto file = folder_ / "b.png";
  std::string damaged = png;
  damaged[kPngHeader + 8 + 18] ^= 1;
  write_file(file, damaged);
  EXPECT_EQ(why_not_upright(file), "expected a whole PNG, got damaged EXIF");
  EXPECT_NO_THROW(decode_image_file(file));
  damaged = png;
  damaged[kPngHeader + 5] ^= 0x20;  // eXIf becomes exIf, which nobody knows
  write_file(file, damaged);
  EXPECT_EQ(why_not_upright(file), "expected a whole PNG, got a damaged chunk of metadata");
  EXPECT_THROWS(image_file_size(file, ImageOrientation::kUpright), std::runtime_error,
                "expected a whole PNG, got a damaged chunk of metadata");
  EXPECT_NO_THROW(decode_image_file(file));
  damaged = png;
  damaged.replace(kPngHeader, 4, "\x7f\xff\xff\xff");
  write_file(file, damaged);
  EXPECT_EQ(why_not_upright(file), "expected a whole PNG, got more than 16 MiB of metadata");
  write_file(file, png.substr(0, kPngHeader + 20));
  EXPECT_EQ(why_not_upright(file), "expected a whole PNG, got one that ends early");
  for (const char* ending : {"jpg", "png", "webp"}) {
    const std::string whole = file_bytes(ending, exif_of(6, true));
    for (std::size_t length = whole.size() - 2; length > 12; length = length * 9 / 10) {
      write_file(file, whole.substr(0, length));
      EXPECT_THAT(why_not_upright(file), HasSubstr("expected a whole ")) << ending << length;
    }
  }
}

}  // namespace
}  // namespace eventgan

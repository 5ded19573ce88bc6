#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// A frame number beyond is damage, not a frame.
inline constexpr std::int64_t kMaxKittiFrame = 999'999'999;

/// One line of a text and its number, counted from 1.
struct TextLine {
  std::string_view bytes;  ///< with its line end, if it has one
  int number = 0;
};

/// The lines of `text`, which concatenated are `text` again, but for a byte order mark before it
/// (Windows' editors write one into UTF-8). Views into `text`.
std::vector<TextLine> split_lines(std::string_view text);

/// The columns of a line between spaces, tabs and line ends (LF or CRLF). Views into `line`.
std::vector<std::string_view> split_columns(std::string_view line);

/// The whole token as a finite number, or nothing. What is too small for the type becomes 0.
template <class Number>
std::optional<Number> parse_number(std::string_view token) {
  Number number{};
  const char* end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, number);
  if (stop != end) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    // from_chars does not tell too small from too large.
    if (error == std::errc::result_out_of_range) {
      number = static_cast<Number>(std::strtod(std::string(token).c_str(), nullptr));
    } else if (error != std::errc()) {
      return std::nullopt;
    }
    if (!std::isfinite(number)) return std::nullopt;
  } else if (error != std::errc()) {
    return std::nullopt;
  }
  return number;
}

/// The number as a whole one, or nothing: beyond 2^53 a double is not exact.
std::optional<std::int64_t> whole_of(double number);

/// The whole token as a whole number, also where a tool has written it as "2.0" (as NumPy and
/// pandas do), or nothing.
std::optional<std::int64_t> parse_whole(std::string_view token);

/// Foreign text for a message: in quotes, cut to 40 characters, all but printable ASCII as '?'.
std::string in_quotes(std::string_view text);

/// "PATH:LINE".
std::string place_in_file(const std::string& path, int line);

/// Car, Van, Truck, Pedestrian, Person_sitting, Cyclist, Tram, Misc, DontCare; no joints.
const LabelSchema& kitti_label_schema();

/// The class of regions to leave out.
inline constexpr int kKittiDontCare = 8;

/// Index of a class name, or -1. KITTI tracking's "Person" and KITTI raw's "Person (sitting)" are
/// Person_sitting.
int kitti_class_id(std::string_view name);

/// Which benchmark's columns a label file has.
enum class KittiColumns {
  kObject,   ///< truncated is a fraction 0..1
  kTracking  ///< frame and track id come first; truncated is a level 0, 1 or 2
};

/// The difficulty of KITTI object: that of its development kit. With h = bottom - top, easy: h ≥ 40
/// px, fully visible, truncated ≤ 0.15; moderate: h ≥ 25, at most partly occluded, ≤ 0.30; hard: h
/// ≥ 25, at most largely occluded, ≤ 0.50. None where either is unknown.
int kitti_difficulty(const Box& box);

/// One object of a label file: type, truncated, occluded (0..3), alpha, left, top, right, bottom,
/// h, w, l, x, y, z, rotation_y, and perhaps a score, which is not kept. Truncated and occluded are
/// -1 where they are unknown. Numbers are taken as they are, except that the unknown 3-D box of
/// tracking's DontCare (location, rotation_y and size, in this order) becomes Box's own.
///
/// The difficulty is that of kitti_difficulty; none for DontCare, and none in tracking.
///
/// DontCare becomes `ignore`, and so does tracking's level 2, an object to be ignored. A fault
/// reads "expected 15 columns, got 7, in WHERE".
Outcome<Box> parse_kitti_object(std::span<const std::string_view> columns, KittiColumns kind,
                                const std::string& where);

/// A whole label file of KITTI object: one object a line, blank lines passed over, `original` is
/// `text` unchanged. A fault names `path` and the line.
Outcome<Annotation> parse_kitti_label(std::string text, const std::string& path);

}  // namespace eventgan

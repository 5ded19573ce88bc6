#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// Of frames that labels number: beyond is damage, not a frame.
inline constexpr std::int64_t kMaxFrameNumber = 999'999'999;

/// One of 0 to 9, whatever the locale.
inline bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Images that a folder of frames may hold. Where a frame is there under two of them, the first
/// counts.
inline const std::vector<std::string_view> kImageExtensions = {
    ".png",  ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp",
    ".jfif", ".mpo", ".ppm",  ".pgm", ".pbm", ".pnm"};

/// An image's name, without extension, about its number.
struct NumberInName {
  std::string before;  ///< all of it, if it has no number
  std::string digits;  ///< empty: no number
  std::string after;   ///< without what Roboflow appends
  std::int64_t number = 0;
  std::int64_t time_ns = -1;  ///< -1: the number is no time
};

/// The number is the last run of digits that no letter follows ("aachen_000000_000019_leftImg8bit"
/// has 19), or the last run if a letter follows each, before what Roboflow appends (".rf.HASH").
/// One that is a time is of seconds with decimals ("315971930.123456") or, of so many digits, of
/// milliseconds (13), microseconds (15, 16) or nanoseconds (18, 19) since some epoch; `number` is
/// `time_ns` then if there are decimals. What is 2^63 or more is no number and no time.
NumberInName find_number(std::string_view stem);

/// The name of an image with another number, of as many digits at least: "a_0012_l.png" for 12 of
/// "a_0003_l.png". A name without number gets it at its end.
std::string renumbered(const std::string& name, std::int64_t number);

/// A folder of frames whose names end in their number: "img_000006.jpg" is frame 6. Listed once;
/// after that no question goes to the disk. A value; reading it from several threads is safe.
class NumberedSequence {
 public:
  using Frame = std::pair<std::int64_t, std::string>;  ///< number, file name

  /// A frame some steps away: what PairedFrame says, before the path is known.
  struct Place {
    PairedFrame::State state = PairedFrame::State::kBeyond;
    std::int64_t number = -1;
    /// Its file name; for a missing frame the name it would have. Empty in an empty sequence.
    std::string name;
  };

  /// How far apart the frames of a sequence are numbered if none is absent.
  enum class Stride {
    kOne,      ///< every frame of the video is stored
    kInferred  ///< perhaps every nth: the smallest difference there is; 1 if fewer than two frames
  };

  NumberedSequence() = default;

  /// Takes frames in any order; numbers must be >= 0, distinct and below 10^18.
  explicit NumberedSequence(std::vector<Frame> frames, Stride stride = Stride::kOne);
  /// The difference of numbers that is one step is known, >= 1.
  NumberedSequence(std::vector<Frame> frames, std::int64_t stride);

  /// Lists the files of `folder` named `prefix` (not ending in a digit), digits (18 at most), one
  /// of `extensions` (lower case, with the dot; the file's may be in capitals); others are left
  /// out. A folder so named counts as a file, which cannot be read. An absent folder gives an
  /// empty sequence. Throws InputError if the folder cannot be read or two files of one extension
  /// have the same number ("1.png", "01.png").
  static NumberedSequence list(const std::filesystem::path& folder, std::string_view prefix = "",
                               const std::vector<std::string_view>& extensions = kImageExtensions,
                               Stride stride = Stride::kOne);

  bool empty() const { return frames_.empty(); }

  /// Ascending by number.
  const std::vector<Frame>& frames() const { return frames_; }

  /// Files that `list` left out, those hidden by a dot not among them: other names than asked for,
  /// and frames that are there under an earlier extension. Sorted.
  const std::vector<std::string>& left_out() const { return left_out_; }

  /// The difference of numbers that is one step.
  std::int64_t stride() const { return stride_; }

  bool contains(std::int64_t number) const;

  /// Frame `number`: present; a missing frame if there are frames on both sides of it; else beyond.
  Place find(std::int64_t number) const;

  /// The frame `steps` strides after `number` (before it, if negative). Frame `number` need not be
  /// there; at 0 steps it is present or a missing frame, never beyond.
  Place at(std::int64_t number, int steps) const;

 private:
  std::vector<Frame>::const_iterator lower_bound(std::int64_t number) const;
  std::string name_for(std::int64_t number) const;

  std::vector<Frame> frames_;
  std::vector<std::string> left_out_;
  std::int64_t stride_ = 1;
};

}  // namespace eventgan

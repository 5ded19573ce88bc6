#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace eventgan {

/// The values of images of 16 bits that become 0 and 255.
struct ValueRange {
  double low = 0;
  double high = 65535;  ///< > low
  bool operator==(const ValueRange&) const = default;
};

/// Size of an image or a volume in pixels; always height first, as arrays are laid out.
struct ImageSize {
  int height = 0;
  int width = 0;

  bool operator==(const ImageSize&) const = default;
  std::size_t pixel_count() const {
    return static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  }
};

/// "640x480", width first.
inline std::string to_string(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// A grey image: [y, x] uint8, C order, 0..255.
struct GreyImage {
  ImageSize size;
  std::vector<std::uint8_t> pixels;
  bool operator==(const GreyImage&) const = default;
};

/// One frame of a sequence.
struct FrameRef {
  /// The source's root as the manifest writes it, then the path below it, with forward slashes. It
  /// is relative to the manifest's folder unless the manifest's root is absolute. For a frame of a
  /// video this is the video's path.
  std::string path;
  std::int64_t index = -1;  ///< the frame's own number in its sequence, as the dataset counts
  std::int64_t video_frame =
      -1;  ///< position in the video or recording counted from 0; -1 if `path` is an image
  double time_s = std::numeric_limits<double>::quiet_NaN();  ///< NaN if unknown

  bool operator==(const FrameRef& other) const {
    return path == other.path && index == other.index && video_frame == other.video_frame;
  }
};

/// What a dataset says of where a frame was taken; empty where it does not.
struct FrameOrigin {
  std::string subject = {};  ///< the person's (Human3.6M: "S1")
  std::string action = {};   ///< what is done (Human3.6M: "Directions-1")
  std::string camera = {};   ///< which of several (Human3.6M: "54138969")
  std::string drive = {};    ///< the recording by a car ("2011_09_26_drive_0052_sync")
  bool operator==(const FrameOrigin&) const = default;
};

/// A motion of a whole image, as a moving camera sees it, or of an object, about the centre c of
/// the image or of the object's box:
///   x' = c + scale R (x - c) + (x_px, y_px),  R = [cos a, -sin a; sin a, cos a], a = angle_deg.
struct ImageMotion {
  double x_px = 0;
  double y_px = 0;
  double angle_deg = 0;  ///< from x towards y: clockwise as one sees it
  double scale = 1;
  bool operator==(const ImageMotion&) const = default;
};

/// Where the image and the objects of a still are in a frame of a clip that is made of it, from
/// where they are in the still: an object moves on its own first, then as the image does.
struct StillPose {
  ImageMotion image = {};
  std::vector<std::optional<ImageMotion>> objects = {};  ///< as FramePair::objects
};

/// Two frames of one sequence, `previous` before `next`, and the labelled frame they belong to. Of
/// events: the begin and the end of a window, as the recording's last frames at or before them.
struct FramePair {
  FrameRef previous;
  FrameRef next;
  int gap_frames = 0;  ///< frames from previous to next, 1..6: of those stored, or taken of a
                       ///< video; 0 of a window of events
  std::int64_t label_index = -1;  ///< FrameRef::index of the labelled frame
  /// Where the labelled frame lies: 0 = previous frame, 1 = next frame, 0.5 = in the middle.
  double label_position = 1;
  /// Of a still: how a point moves from the previous image to the next. Both frames are the
  /// labelled image then; the one that is not at `label_position` is it under this motion.
  std::optional<ImageMotion> motion = std::nullopt;
  /// Of a still whose objects move on their own: for each box of its annotation, the object's
  /// motion before `motion` is added, about the box's centre; none of a box that does not: what
  /// lies in it moves as the image does. Empty: no box does.
  std::vector<std::optional<ImageMotion>> objects = {};
  /// Of two frames of a clip made of a still (PairSpec::clip_frames), both poses; else empty.
  std::vector<StillPose> poses = {};

  /// NaN if either time is unknown.
  double gap_s() const { return next.time_s - previous.time_s; }

  /// Of two frames of one video: how many of its frames one step is, where it is thinned and its
  /// frames at the multiples of that are taken; else 1.
  std::int64_t video_stride() const {
    const std::int64_t frames = next.video_frame - previous.video_frame;
    const std::int64_t stride = gap_frames > 0 ? frames / gap_frames : 1;
    const bool fits = stride > 0 && frames % stride == 0 && next.video_frame % stride == 0;
    return fits ? stride : 1;
  }
};

/// What is seen between two frames, in the size of the generator's input.
struct FramesBetween {
  /// The frame at u in [0, 1] of the time from the first frame (0) to the second (1). At the ends
  /// it is these frames. Null: nobody knows. Thread safe.
  std::function<GreyImage(double u)> at = {};
  double displacement_px = 0;  ///< no point of a frame moves farther from the first to the second
};

}  // namespace eventgan

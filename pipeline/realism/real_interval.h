#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// Two frames of a recording, by their indices.
struct FrameInterval {
  std::int64_t first = 0;
  std::int64_t last = 0;
  int gap() const { return static_cast<int>(last - first); }
  bool operator==(const FrameInterval&) const = default;
};

/// The pairs (i, i + gap) with both frames in first..last, by gap, then i. Throws UsageError if
/// there is none, a gap is below 1 or named twice, or a frame is not in the recording.
std::vector<FrameInterval> choose_intervals(const Recording& recording, std::int64_t first,
                                            std::optional<std::int64_t> last,
                                            const std::vector<int>& gaps);

/// What the methods see of an interval, and the number of events they should make.
struct IntervalFrames {
  FrameInterval interval;
  double duration_s = 0;
  GreyImage previous;
  GreyImage next;
  std::int64_t event_count = 0;
  std::int64_t positive_count = 0;  ///< of these
};

/// An interval with what the camera saw in it.
struct RealInterval {
  IntervalFrames frames;
  std::vector<float> volume;      ///< [2 bins, y, x] float32, normalised by η98, in [0, 1]
  std::optional<FlowField> flow;  ///< true displacement over the interval, where it is known
};

/// What the network sees of them: [frame, y, x] float32, previous then next, in [-1, 1], at their
/// own size.
std::vector<float> network_input(const IntervalFrames& frames);

/// All throw InputError as Recording does. Thread safe. `events`: those of the interval.
IntervalFrames frames_of(const Recording& recording, const FrameInterval& interval,
                         const std::vector<Event>& events);
IntervalFrames read_frames(const Recording& recording, const FrameInterval& interval);
RealInterval read_interval(const Recording& recording, const FrameInterval& interval, int bins);

/// The true displacement over an interval of several frames: each pixel of the first frame is
/// carried along the flows of the frame intervals, u_k(x) = u_{k-1}(x) + f_k(x + u_{k-1}(x)),
/// bilinear between pixels. An approximation: where another surface comes in front on the way, the
/// pixel goes on with that surface. NaN where the path leaves the image or the flow is not known.
/// None if the recording does not know its flow. Throws InputError as Recording does. Thread safe.
std::optional<FlowField> flow_path(const Recording& recording, const FrameInterval& interval);

}  // namespace eventgan

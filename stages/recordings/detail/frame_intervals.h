#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace eventgan {

/// Throws InputError unless there is a frame and the times are finite and strictly ascending;
/// `place` is where they are: "expected X, got Y, in PLACE (frame 3)".
void check_frame_times(const std::vector<double>& times_s, const std::string& place);

/// Two frames of a recording as positions in a vector, `first` ≤ `last`.
struct FrameRange {
  std::size_t first = 0;
  std::size_t last = 0;
};

/// Both throw std::out_of_range naming the recording if there is no such frame or range.
std::size_t frame_position(std::int64_t index, std::int64_t count, const std::string& recording);
FrameRange frame_range(std::int64_t first, std::int64_t last, std::int64_t count,
                       const std::string& recording);

/// How many of the first events are at or before each frame, or how many bytes of text they take:
/// found when first asked for, then kept. Thread safe: two threads that ask at once both search.
class EventBoundaries {
 public:
  explicit EventBoundaries(std::size_t frame_count) : found_(frame_count) {}

  template <class Find>
  std::int64_t at(std::size_t frame, Find find) const {
    std::atomic<std::int64_t>& found = found_[frame];
    if (const std::int64_t known = found.load()) return known - 1;
    const std::int64_t boundary = find();
    found.store(boundary + 1);
    return boundary;
  }

 private:
  mutable std::vector<std::atomic<std::int64_t>> found_;  ///< plus one; 0: not known
};

/// Reads the times of `count` events from event `first` on.
using ReadTimes = std::function<std::vector<double>(std::int64_t first, std::int64_t count)>;

/// How many of `count` events in time order are at or before `time_s`. Looks near event `guess`
/// first, then halves what is left: one read for a good guess, about log2(count / 1024) for a bad
/// one. Of events that are not in time order it gives some number 0..count.
std::int64_t count_events_until(double time_s, std::int64_t guess, std::int64_t count,
                                const ReadTimes& read_times);

}  // namespace eventgan

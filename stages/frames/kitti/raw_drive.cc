#include "stages/frames/kitti/raw_drive.h"

#include <limits>

#include "stages/frames/kitti/timestamps.h"

namespace eventgan {

RawDrive::RawDrive(const SourceRoot& root, const std::string& folder)
    : pictures_path_(root.written(folder + "/image_02/data")),
      pictures_(NumberedSequence::list(root.on_disk(folder + "/image_02/data"))) {
  const std::string timestamps = folder + "/image_02/timestamps.txt";
  if (pictures_.empty() || !root.has_file(timestamps)) return;
  timestamps_path_ = root.written(timestamps);
  times_s_ = parse_timestamps(root.read_or_throw(timestamps), timestamps_path_);
}

Neighbour RawDrive::frame(std::int64_t number) const { return at(pictures_.find(number)); }

Neighbour RawDrive::neighbour(std::int64_t number, int steps) const {
  return at(pictures_.at(number, steps));
}

Neighbour RawDrive::at(const NumberedSequence::Place& place) const {
  return {place.state, {pictures_path_ + "/" + place.name, place.number, -1, time_s(place.number)}};
}

double RawDrive::time_s(std::int64_t number) const {
  if (timestamps_path_.empty()) return static_cast<double>(number) * kKittiFrameSeconds;
  const auto line = static_cast<std::size_t>(number);
  return number >= 0 && line < times_s_.size() ? times_s_[line]
                                               : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace eventgan

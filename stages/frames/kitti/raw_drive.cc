#include "stages/frames/kitti/raw_drive.h"

#include <iterator>
#include <limits>
#include <utility>

#include "stages/frames/kitti/timestamps.h"

namespace eventgan {

RawDrive::RawDrive(const SourceRoot& root, const std::string& folder)
    : pictures_path_(root.written(folder + "/image_02/data")),
      pictures_(NumberedSequence::list(root.on_disk(folder + "/image_02/data"))) {
  const std::string timestamps = folder + "/image_02/timestamps.txt";
  if (pictures_.empty() || !root.has_file(timestamps)) return;
  timestamps_path_ = root.written(timestamps);
  const auto text = root.read(timestamps);
  Outcome<std::vector<double>> times =
      is_fault(text) ? std::get<SampleFault>(text)
                     : parse_timestamps(std::get<std::string>(text), timestamps_path_);
  if (const auto* fault = std::get_if<SampleFault>(&times)) {
    fault_ = fault->reason;
    return;
  }
  times_s_ = std::get<std::vector<double>>(std::move(times));
  const std::int64_t last = pictures_.frames().back().first;
  if (last < std::ssize(times_s_)) return;
  fault_ = "expected a line for each frame up to " + std::to_string(last) + ", got " +
           std::to_string(times_s_.size()) + " lines, in " + timestamps_path_;
  times_s_.clear();
}

Neighbour RawDrive::frame(std::int64_t number) const { return at(pictures_.find(number)); }

Neighbour RawDrive::neighbour(std::int64_t number, int steps) const {
  return at(pictures_.at(number, steps));
}

Neighbour RawDrive::at(const NumberedSequence::Place& place) const {
  if (place.number < 0) return {};
  return {place.state, {pictures_path_ + "/" + place.name, place.number, -1, time_s(place.number)}};
}

double RawDrive::time_s(std::int64_t number) const {
  if (timestamps_path_.empty()) return static_cast<double>(number) * kKittiFrameSeconds;
  const auto line = static_cast<std::size_t>(number);
  return number >= 0 && line < times_s_.size() ? times_s_[line]
                                               : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace eventgan

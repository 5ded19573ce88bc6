#include "stages/frames/kitti/object_pictures.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace eventgan {
namespace {

using State = Neighbour::State;

/// "_01" for the frame one before.
std::string previous_mark(int steps_back) { return "_0" + std::to_string(steps_back); }

}  // namespace

ObjectPictures::ObjectPictures(const SourceRoot& root) {
  root.require_folder("image_2");
  labelled_ = NumberedSequence::list(root.on_disk("image_2"));
  for (int k = 1; k <= kPrevious; ++k) {
    // A frame's number in prev_2 is the labelled picture's; the mark counts as part of the
    // extension.
    std::vector<std::string> marked;
    for (const std::string_view extension : kPictureExtensions) {
      marked.push_back(previous_mark(k).append(extension));
    }
    const NumberedSequence& listed = previous_[static_cast<std::size_t>(k - 1)] =
        NumberedSequence::list(root.on_disk("prev_2"), "", {marked.begin(), marked.end()});
    // The frames of one K are left out of the others' lists.
    std::vector<std::string> in_none = k == 1 ? listed.left_out() : std::vector<std::string>();
    std::ranges::set_intersection(previous_left_out_, listed.left_out(),
                                  std::back_inserter(in_none));
    previous_left_out_ = std::move(in_none);
  }
}

ObjectPictures::Place ObjectPictures::at(std::int64_t number, const std::string& stem,
                                         int steps) const {
  if (steps == 0) {
    const auto place = labelled_.find(number);
    if (place.state == State::kPresent) return {State::kPresent, "image_2/" + place.name};
    return {State::kHole, "image_2/" + stem + ".png"};
  }
  const auto back = static_cast<std::size_t>(-steps);
  const auto place = previous_[back - 1].find(number);
  if (place.state == State::kPresent) return {State::kPresent, "prev_2/" + place.name};
  State state = State::kBeyond;
  for (std::size_t further = back; further < previous_.size(); ++further) {
    if (previous_[further].contains(number)) state = State::kHole;
  }
  return {state, "prev_2/" + stem + previous_mark(-steps) + ".png"};
}

}  // namespace eventgan

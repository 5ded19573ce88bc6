#pragma once

#include <fmt/core.h>

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/recordings/order/packed_bytes.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// A frame as a file has it.
struct PlacedFrame {
  double time_s = 0;
  bool is_colour = false;
  bool is_deep = false;  ///< of 16 bits
  GreyImage image = {};
};

/// The frames of a file that lie among its events. The events do without a frame that is damaged,
/// of another size or no later than the one before: it is left out.
template <class Place>
class PlacedFrames final : public FrameStore {
 public:
  /// `read` a frame of the recording's size, or throws InputError. Thread safe.
  PlacedFrames(std::string name, std::function<PlacedFrame(const Place&)> read)
      : name_(std::move(name)), read_(std::move(read)) {}

  /// The next frame, which `make` gives as `read` would.
  template <class Make>
  void add(const Place& place, Make make) {
    try {
      const PlacedFrame frame = make();
      if (!times_s_.empty() && frame.time_s <= times_s_.back()) {
        throw InputError(fmt::format("expected a frame after {:.6f} s, got one at {:.6f} s, in {}",
                                     times_s_.back(), frame.time_s, name_));
      }
      places_.push_back(place);
      times_s_.push_back(frame.time_s);
      in_colour_ |= frame.is_colour;
      deep_ |= frame.is_deep;
    } catch (const InputError& error) {
      if (left_out_++ == 0) reason_ = error.what();
    }
  }
  void add(const Place& place) {
    add(place, [&] { return read_(place); });
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    if (in_colour_) notes.push_back("frames in colour are made grey, in " + name_);
    if (deep_) notes.push_back("of frames of 16 bits the upper 8 are taken, in " + name_);
    if (left_out_ > 0) {
      notes.push_back(fmt::format("frames left out: {} (the first: {})", left_out_, reason_));
    }
    return notes;
  }

  const std::vector<double>& times_s() const override { return times_s_; }

  GreyImage read(std::int64_t index) const override {
    return read_(places_[static_cast<std::size_t>(index)]).image;
  }

  /// What is known of the frames; the second takes it off `bytes`, false if it is not there.
  void pack_frames(std::string& bytes) const {
    pack(bytes, places_);
    pack(bytes, times_s_);
    pack(bytes, in_colour_);
    pack(bytes, deep_);
    pack(bytes, left_out_);
    pack(bytes, reason_);
  }
  bool unpack_frames(std::string_view& bytes) {
    return unpack(bytes, places_) && unpack(bytes, times_s_) && unpack(bytes, in_colour_) &&
           unpack(bytes, deep_) && unpack(bytes, left_out_) && unpack(bytes, reason_) &&
           places_.size() == times_s_.size();
  }

 private:
  std::string name_;
  std::function<PlacedFrame(const Place&)> read_;
  std::vector<Place> places_;
  std::vector<double> times_s_;
  bool in_colour_ = false;
  bool deep_ = false;
  std::int64_t left_out_ = 0;
  std::string reason_;
};

}  // namespace eventgan

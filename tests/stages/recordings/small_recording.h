#pragma once

#include <map>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "tests/testing/hdf5_file.h"

namespace eventgan::testing {

/// Three frames of 4x3 pixels (width x height) at 1.0, 1.5 and 2.0 s, frame i full of the value
/// 10 (i + 1), and seven events: one before the first frame, one at its time, two in the first
/// interval, two in the second (the last one at the frame's time), one after the last frame.
inline const std::vector<double> kSmallTimes = {1.0, 1.5, 2.0};

inline std::vector<Event> small_events() {
  return {{0, 0, 0.5, true},  {1, 0, 1.0, false}, {2, 1, 1.25, true}, {3, 2, 1.25, false},
          {0, 2, 1.75, true}, {3, 0, 2.0, true},  {1, 1, 2.5, false}};
}

/// It as the datasets of MVSEC's layout; flow of frame i: (i + 1, -(i + 1)) everywhere.
inline std::map<std::string, Hdf5Dataset> small_mvsec() {
  std::vector<double> rows;
  for (const Event& event : small_events()) {
    rows.insert(rows.end(), {static_cast<double>(event.x), static_cast<double>(event.y), event.t_s,
                             event.positive ? 1.0 : -1.0});
  }
  std::vector<std::uint8_t> pixels;
  std::vector<float> flow;
  for (int i = 1; i <= 3; ++i) pixels.insert(pixels.end(), 12, static_cast<std::uint8_t>(10 * i));
  for (int i = 1; i <= 2; ++i) {
    flow.insert(flow.end(), 12, static_cast<float>(i));
    flow.insert(flow.end(), 12, static_cast<float>(-i));
  }
  return {{"davis/left/events", {{7, 4}, rows}},
          {"davis/left/image_raw", {{3, 3, 4}, pixels}},
          {"davis/left/image_raw_ts", {{3}, kSmallTimes}},
          {"davis/left/image_raw_event_inds", {{3}, std::vector<std::int64_t>{1, 3, 5}}},
          {"davis/left/flow_dist", {{2, 2, 3, 4}, flow}}};
}

}  // namespace eventgan::testing

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "stages/recordings/order/event_check.h"

namespace eventgan {

/// What was passed over.
struct WordCounts {
  std::int64_t left_out = 0;    ///< events before their time and place were told
  std::int64_t outside = 0;     ///< events beside the sensor
  std::int64_t reserved = 0;    ///< words of types that mean nothing
  std::int64_t steps_back = 0;  ///< events before an earlier one, by too much to be lifted
};

/// What a word's meaning depends on: all that the words before it have said.
struct WordState {
  std::optional<std::uint32_t> counter;      ///< the upper part of the time as stored, or all of it
  std::int64_t wraps = 0;                    ///< of the counter
  std::optional<std::uint32_t> before_jump;  ///< the counter, if it then moved by half its range
  std::int64_t wraps_before_jump = 0;
  std::int64_t shift_us = 0;    ///< taken off all times
  std::uint32_t low_us = 0;     ///< EVT 3.0: the lower part
  std::optional<int> y;         ///< EVT 3.0
  std::optional<int> vector_x;  ///< EVT 3.0: of the next vector's first pixel
  bool vector_on = false;
  bool is_second_camera = false;
  std::int64_t last_us = 0;  ///< of the last event that was not lifted
  WordCounts counts;
};

inline constexpr std::size_t kMostEventsPerWord = 32;
using WordEvents = std::array<StoredEvent, kMostEventsPerWord>;

/// Takes a word of EVT 3.0, and gives how many events it is. Unless `shifts` is false, times count
/// from the first upper part of a time. Throws EventFault.
std::size_t take_evt3(std::uint16_t word, WordState& state, bool shifts, WordEvents& events);

}  // namespace eventgan

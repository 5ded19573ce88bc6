#pragma once

#include <string_view>

#include "stages/recordings/event_check_internal.h"

namespace eventgan {

/// Parses a line "t x y p" of an ECD `events.txt`: t in seconds, the others whole numbers,
/// between blanks or tabs; without its line end, but for a CR. Throws EventFault.
StoredEvent parse_ecd_event(std::string_view line);

/// Its time alone, which must be finite here, since it is searched by.
double parse_ecd_event_time(std::string_view line);

}  // namespace eventgan

#include "stages/frames/dataset/dataset.h"

#include <cmath>
#include <stdexcept>

namespace eventgan {

void EventWindow::tell_times(FramePair& pair) const {
  if (!std::isnan(pair.previous.time_s) || events.empty()) return;
  pair.previous.time_s = events.front().t_s;
  pair.next.time_s = events.back().t_s;
}

ImageSize Dataset::sensor_size(const std::string& label_key) const {
  throw std::logic_error("expected a dataset of events, got one of frames (" + label_key + ")");
}

Outcome<EventWindow> Dataset::events(const std::string& label_key) const {
  throw std::logic_error("expected a dataset of events, got one of frames (" + label_key + ")");
}

}  // namespace eventgan

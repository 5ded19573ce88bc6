#include "pipeline/realism/realism_picture.h"

#include <fmt/core.h>

#include "stages/events/pictures/comparison_picture.h"

namespace eventgan {
void write_realism_picture(const RealInterval& real, std::span<const NamedVolume> volumes, int bins,
                           const std::filesystem::path& folder) {
  if (volumes.empty()) return;
  const FrameInterval interval = real.frames.interval;
  std::vector<ComparedPair> rows;
  for (const NamedVolume& named : volumes) {
    rows.push_back(
        {{bins, real.frames.previous.size},
         network_input(real.frames),
         named.volume,
         real.volume,
         fmt::format("{}, frames {} and {}", named.method, interval.first, interval.last)});
  }
  write_comparison_png(rows,
                       folder / fmt::format("{:06}-{:06}.png", interval.first, interval.last));
}

}  // namespace eventgan

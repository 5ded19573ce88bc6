#include "pipeline/realism/realism_picture.h"

#include <cstdio>

#include "stages/events/pictures/comparison_picture.h"

namespace eventgan {
namespace {

std::string picture_name(const FrameInterval& interval) {
  char text[64];
  std::snprintf(text, sizeof text, "%06lld-%06lld.png", static_cast<long long>(interval.first),
                static_cast<long long>(interval.last));
  return text;
}

}  // namespace

void write_realism_picture(const RealInterval& real, std::span<const NamedVolume> volumes, int bins,
                           const std::filesystem::path& folder) {
  if (volumes.empty()) return;
  const FrameInterval interval = real.frames.interval;
  std::vector<ComparedPair> rows;
  for (const NamedVolume& named : volumes) {
    rows.push_back({{bins, real.frames.previous.size},
                    network_input(real.frames),
                    named.volume,
                    real.volume,
                    named.method + ", frames " + std::to_string(interval.first) + " and " +
                        std::to_string(interval.last)});
  }
  write_comparison_png(rows, folder / picture_name(interval));
}

}  // namespace eventgan

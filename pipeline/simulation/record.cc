#include "pipeline/simulation/record.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/memory/memory_limit.h"
#include "stages/events/simulation/sensor.h"
#include "stages/events/simulation/simulate_pair.h"
#include "stages/recordings/mvsec_writer.h"

namespace eventgan {
namespace {

/// The 99.5th percentile over the pixels of how far they move; single pixels of a computed flow may
/// be far off.
double displacement(const FlowField& flow) {
  constexpr double kShare = 0.995;
  std::vector<float> lengths(flow.x_px.size());
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    lengths[i] = std::hypot(flow.x_px[i], flow.y_px[i]);
  }
  if (lengths.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(kShare * static_cast<double>(lengths.size() - 1));
  std::nth_element(lengths.begin(), lengths.begin() + rank, lengths.end());
  return lengths[static_cast<std::size_t>(rank)];
}

}  // namespace

RecordingSummary record(Scene& scene, const SensorSpec& spec, CounterRandom random,
                        const std::filesystem::path& file, const std::string& settings,
                        const std::function<void()>& on_frame) {
  const ImageSize size = scene.frame().size;
  RecordingSummary summary;
  summary.name = file.stem().string();
  summary.pixels = static_cast<std::int64_t>(size.pixel_count());
  MvsecWriter writer(file, size, settings);
  const auto add_frame = [&](const FlowField* flow) {
    writer.add_frame(scene.frame(), scene.time_s(), flow);
    ++summary.frames;
    on_frame();
  };
  add_frame(nullptr);

  Sensor sensor(spec, size, random);
  double from_s = scene.time_s();
  while (const auto interval = scene.advance()) {
    if (summary.frames == 1) sensor.step(interval->render(0), from_s);
    check_events_fit(spec, size, scene.time_s() - from_s, memory_limit_bytes());
    std::vector<Event> events;
    feed_interval(sensor, *interval, from_s, scene.time_s(), events);
    writer.add_events(events);
    std::optional<FlowField> flow;
    if (scene.has_flow()) {
      FlowDisplacement moved = interval->flow();
      flow = FlowField{moved.size, std::move(moved.x_px), std::move(moved.y_px)};
      summary.displacement_px = std::max(summary.displacement_px, displacement(*flow));
    }
    add_frame(flow ? &*flow : nullptr);
    summary.events += std::ssize(events);
    summary.duration_s += scene.time_s() - std::exchange(from_s, scene.time_s());
  }
  writer.commit();
  return summary;
}

}  // namespace eventgan

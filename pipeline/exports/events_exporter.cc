#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "manifests/values/counter_random.h"
#include "pipeline/exports/detail/exporter.h"
#include "stages/exports/sampled_events.h"
#include "stages/recordings/mvsec_writer.h"

namespace eventgan {
namespace {

/// Of a pair whose frames' times are not known.
constexpr double kUnknownGap_s = 1;

/// A recording of two black frames, since shards have no images, and the events between them.
void write_recording(const std::filesystem::path& path, ImageSize size, std::vector<Event> events,
                     double gap_s, const std::string& settings) {
  // MVSEC's readers take the events after a frame's time.
  const double earliest_s = gap_s * 1e-9;
  for (Event& event : events) event.t_s = std::max(event.t_s, earliest_s);
  const GreyImage black{size, std::vector<std::uint8_t>(size.pixel_count())};
  MvsecWriter writer(path, size, settings);
  writer.add_frame(black, 0, nullptr);
  writer.add_events(events);
  writer.add_frame(black, gap_s, nullptr);
  writer.commit();
}

/// events/SPLIT/NAME.txt or .hdf5.
class EventsExporter : public Exporter {
 public:
  explicit EventsExporter(const ExportOptions& options)
      : counts_(options.counts), file_(options.event_file), seed_(options.seed) {}

  std::string settings() const override {
    return fmt::format("counts {}\nfile {}\nseed {}\n",
                       counts_ == EventCounts::kPoisson ? "poisson" : "rounded",
                       file_ == EventFile::kText ? "text" : "mvsec", seed_);
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      const VolumeShape& shape = reader.header().volume;
      const double known_s = sample.labels.pair.gap_s();
      const double gap_s = known_s > 0 ? known_s : kUnknownGap_s;
      const CounterRandom random =
          CounterRandom(seed_).keyed(sample.source.dataset).keyed(sample.labels.sample_id);
      const std::vector<Event> events =
          sample_events(reader.volume(sample.slot), shape, gap_s, counts_, random);
      const std::string name = "events/" + sample.source.split + "/" + sample.name;
      if (file_ == EventFile::kText) {
        step.write(name + ".txt", events_text(events));
      } else {
        write_recording(step.file(name + ".hdf5"), shape.size, events, gap_s,
                        "eventgan export --to events\n" + settings());
      }
    });
  }

 private:
  EventCounts counts_;
  EventFile file_;
  std::uint64_t seed_;
};

}  // namespace

std::unique_ptr<Exporter> events_exporter(const ExportOptions& options) {
  return std::make_unique<EventsExporter>(options);
}

}  // namespace eventgan

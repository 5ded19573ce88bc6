#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "pipeline/exports/detail/sample_events.h"
#include "stages/exports/sampled_events.h"
#include "stages/recordings/writers/mvsec_writer.h"

namespace eventgan {
namespace {

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
  EventsExporter(const ExportInput& input, const ExportOptions& options)
      : options_(options), events_(input, options) {}

  std::string settings() const override {
    return fmt::format("{}file {}\nseed {}\n", events_.settings(),
                       options_.event_file == EventFile::kText ? "text" : "mvsec", options_.seed);
  }

  void check(const ExportInput&, const std::function<void()>&) const override { events_.open(); }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    work.for_each_sample(shard, reader, [&](const OutgoingSample& sample) {
      const double gap_s = known_gap_s(sample.labels.pair);
      const std::vector<Event> events = events_.of(sample, gap_s);
      const std::string name = "events/" + sample.source.split + "/" + sample.name;
      if (options_.event_file == EventFile::kText) {
        step.write(name + ".txt", events_text(events));
      } else {
        write_recording(step.file(name + ".hdf5"), reader.header().volume.size, events, gap_s,
                        "eventgan export --to events\n" + settings());
      }
    });
  }

 private:
  ExportOptions options_;
  SampleEvents events_;
};

}  // namespace

ExportFormat events_format() {
  return {.word = "events",
          .title = "events, as text or in MVSEC's layout",
          .need = LabelNeed::kNone,
          .options = {"--counts", "--layout", "--seed"},
          .files = {{"events/SPLIT/NAME.txt",
                     "an event a line: seconds, column, row, polarity 1 or 0",
                     {{"", "t:Float x:Integer y:Integer p:Integer"}}},
                    {"events/SPLIT/NAME.hdf5", "the same in MVSEC's layout"}},
          .make = make_exporter<EventsExporter>};
}

}  // namespace eventgan

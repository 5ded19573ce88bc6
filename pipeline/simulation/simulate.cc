#include "pipeline/simulation/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "manifests/documents/report.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/generators/simulated_generator.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/simulation/clip_frames.h"
#include "pipeline/simulation/recording_output.h"
#include "pipeline/simulation/recording_plan.h"
#include "pipeline/simulation/scene.h"
#include "pipeline/simulation/still_scenes.h"
#include "stages/events/simulation/sensor.h"
#include "stages/events/simulation/simulate_pair.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/recordings/writers/evt3_writer.h"

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
                        const std::function<void()>& on_frame,
                        const std::function<void()>& before_publishing) {
  const ImageSize size = scene.frame().size;
  RecordingSummary summary;
  summary.name = file.stem().string();
  summary.pixels = static_cast<std::int64_t>(size.pixel_count());
  const auto writer = open_recording_output(file, size, settings);
  const auto add_frame = [&](const FlowField* flow) {
    writer->add_frame(scene.frame(), scene.time_s(), flow);
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
    writer->add_events(events);
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
  writer->commit(before_publishing);
  return summary;
}

namespace {

namespace fs = std::filesystem;

/// A source, its clip, and the recordings of it that are to be made, one after another. Of stills,
/// which are not read in order, there is one work for each recording.
struct SourceWork {
  const SimulationSource* source = nullptr;
  std::unique_ptr<ClipFrames> clip;  ///< null for stills
  std::shared_ptr<const StillScenes> stills;
  std::vector<PlannedRecording> to_do;
  std::vector<RecordingSummary> made;
};

fs::path labels_beside(const fs::path& recording) {
  return fs::path(recording).replace_extension(".json");
}

/// Throws UsageError if the recording's labels would replace another file or, without `overwrite`,
/// other labels: those of a recording of another format, or corrected ones.
void check_labels(const PlannedRecording& recording, const StillScenes& stills, bool overwrite) {
  const fs::path file = labels_beside(recording.file);
  if (!fs::exists(file)) return;
  constexpr std::string_view kBegin = R"({"format":"eventgan-labels")";
  const std::string found = read_text_file(file);
  if (!found.starts_with(kBegin)) {
    throw UsageError(
        "expected labels that eventgan simulate has written, or no file, got another, "
        "in " +
        file.string() + " (choose another output folder, or remove it yourself)");
  }
  if (overwrite || found == stills.labels(recording.image.value())) return;
  throw UsageError("expected the labels that this run would write, or no file, got others, in " +
                   file.string() + " (--overwrite replaces them; or choose another output folder)");
}

/// Of frames that are not scaled to a size of the manifest's, whose own rule this is.
void require_raw_size(ImageSize frame, const std::string& path) {
  constexpr int kMost = Evt3Writer::kLargestSide;
  if (frame.width <= kMost && frame.height <= kMost) return;
  throw UsageError(
      fmt::format("expected frames of 1 to {} pixels a side for the format raw, got "
                  "{}x{}, in {} (\"size\" scales them)",
                  kMost, frame.width, frame.height, path));
}

/// Opens every source's clip and leaves out the recordings that are there, or with `overwrite`
/// makes sure that they are of this clip. Labels that are missing beside a still's recording are
/// written. Clips that cannot be opened and stills with a fault are left out and added to `faults`.
std::vector<SourceWork> plan_work(const SimulationManifest& manifest, const fs::path& folder,
                                  bool overwrite, std::vector<std::string>& kept,
                                  std::vector<std::string>& faults) {
  const bool any_size = manifest.file == SimulatedFile::kRaw && !manifest.size;
  std::vector<SourceWork> works;
  const auto is_to_do = [&](const PlannedRecording& recording) {
    const auto found = settings_on_disk(recording.file);
    if (found && overwrite) check_same_clip(recording.file, *found, recording.settings);
    if (!found || overwrite) return true;
    check_same_settings(recording.file, *found, recording.settings);
    kept.push_back(recording.name);
    return false;
  };
  const auto plan_stills = [&](const SimulationSource& source,
                               const std::shared_ptr<const StillScenes>& stills) {
    for (PlannedRecording& recording : plan_recordings(manifest, source, *stills, folder, faults)) {
      const std::int64_t position = recording.image.value();
      const bool to_do = is_to_do(recording);
      if (to_do && any_size) {
        require_raw_size(stills->frame_size(position), stills->still(position));
      }
      const fs::path labels = labels_beside(recording.file);
      try {
        if (to_do) {
          check_labels(recording, *stills, overwrite);
        } else if (!fs::exists(labels)) {  // somebody has removed them
          write_file_atomically(labels, stills->labels(position));
        }
      } catch (const InputError& error) {
        faults.push_back(fmt::format("{} ({})", error.what(), stills->still(position)));
        continue;
      }
      if (!to_do) continue;
      works.push_back({&source, nullptr, stills, {}, {}});
      works.back().to_do.push_back(std::move(recording));
    }
  };
  for (const SimulationSource& source : manifest.sources) {
    SourceWork work{&source, nullptr, nullptr, {}, {}};
    try {
      if (source.method.motion == SimulationMethod::kStills) {
        work.stills = std::make_shared<const StillScenes>(source, manifest);
      } else {
        work.clip = std::make_unique<ClipFrames>(source, manifest);
      }
    } catch (const InputError& error) {  // the others are made
      faults.push_back(error.what());
      continue;
    }
    if (work.stills) {
      plan_stills(source, work.stills);
      continue;
    }
    for (PlannedRecording& recording : plan_recordings(manifest, source, *work.clip, folder)) {
      if (is_to_do(recording)) work.to_do.push_back(std::move(recording));
    }
    if (any_size && !work.to_do.empty()) require_raw_size(work.clip->frame(0).size, source.path);
    works.push_back(std::move(work));
  }
  return works;
}

std::unique_ptr<Scene> make_scene(const SourceWork& work, const PlannedRecording& recording,
                                  CounterRandom random) {
  const SimulationSource& source = *work.source;
  switch (source.method.motion) {
    case SimulationMethod::kClip:
      return std::make_unique<ClipScene>(*work.clip);
    case SimulationMethod::kStills:
      return work.stills->scene(recording.image.value());
    case SimulationMethod::kSimulator:
      if (source.method.moves_one_frame()) break;
      return std::make_unique<ClipScene>(*work.clip, simulator(source.method.simulator).between);
  }
  GreyImage image = work.clip->frame(recording.image.value());
  const int frames = source.frames_per_image;
  const double a_frame_px = source.max_displacement_px * random.keyed("displacement").uniform(0);
  const AffineMotion motion =
      random_affine_motion(image.size, a_frame_px * frames, random.keyed("motion"));
  return std::make_unique<AffineScene>(std::move(image), motion, frames, 1 / work.clip->rate_hz());
}

std::int64_t frame_total(const std::vector<SourceWork>& works) {
  std::int64_t frames = 0;
  for (const SourceWork& work : works) {
    for (const PlannedRecording& recording : work.to_do) frames += recording.frame_count;
  }
  return frames;
}

void run(SourceWork& work, const SimulationManifest& manifest, bool overwrite,
         const std::function<void()>& on_frame) {
  for (const PlannedRecording& recording : work.to_do) {
    const CounterRandom random = CounterRandom(manifest.seed).keyed(recording.name);
    const auto scene = make_scene(work, recording, random);
    std::optional<AtomicFile> labels;
    if (work.stills) {
      labels.emplace(labels_beside(recording.file)).create();
      labels->write(work.stills->labels(recording.image.value()));
      labels->sync();
    }
    // Both are on disk by then, so that a full disk costs nothing of what is there. Never new
    // labels beside an old recording, even if this ends here.
    const auto publish_labels = [&] {
      if (!labels) return;
      if (overwrite && fs::remove(recording.file)) sync_to_disk(recording.file.parent_path());
      labels->publish();
    };
    work.made.push_back(record(*scene, manifest.sensor, random.keyed("sensor"), recording.file,
                               recording.settings, on_frame, publish_labels));
  }
}

}  // namespace

SimulationReport simulate(const SimulationManifest& manifest, const SimulationOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path folder = options.output.value_or(resolve(manifest, manifest.output_directory));
  SimulationReport report;
  report.folder = folder.string();
  require_no_images(folder);
  fs::create_directories(folder);
  remove_stale_temporaries(folder);
  std::vector<std::string> faults;
  std::vector<SourceWork> works =
      plan_work(manifest, folder, options.overwrite, report.kept, faults);

  const std::int64_t frames = frame_total(works);
  const std::unique_ptr<Progress> progress =
      options.make_progress && frames > 0 ? options.make_progress(frames) : nullptr;
  std::mutex showing, failing;
  const auto on_frame = [&] {
    if (!progress) return;
    const std::lock_guard lock(showing);
    progress->advance(/*quarantined=*/false, /*bytes=*/0);
  };
  for_each_index(works.size(), thread_count(options.threads), [&](std::size_t i) {
    try {
      run(works[i], manifest, options.overwrite, on_frame);
    } catch (const InputError& error) {  // the others are made
      const std::lock_guard lock(failing);
      faults.push_back(error.what());
    }
  });
  if (progress) progress->finish();
  std::ranges::sort(faults);
  if (!faults.empty()) throw InputError(fmt::format("{}", fmt::join(faults, "\n")));

  for (const SourceWork& work : works) {
    report.made.insert(report.made.end(), work.made.begin(), work.made.end());
  }
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

namespace {

/// All recordings as one; pixels and duration are those of one with the same events a pixel and
/// second.
RecordingSummary sum(const std::vector<RecordingSummary>& recordings) {
  RecordingSummary total;
  double pixel_seconds = 0;
  for (const RecordingSummary& recording : recordings) {
    total.frames += recording.frames;
    total.events += recording.events;
    total.displacement_px = std::max(total.displacement_px, recording.displacement_px);
    pixel_seconds += static_cast<double>(recording.pixels) * recording.duration_s;
  }
  total.name = "all";
  total.pixels = 1;
  total.duration_s = pixel_seconds;
  return total;
}

std::string table_line(const RecordingSummary& recording) {
  return fmt::format("{:24.200} {:8} {:12} {:10.3f} {:10.1f}\n", recording.name, recording.frames,
                     recording.events, recording.events_per_pixel_second(),
                     recording.displacement_px);
}

nlohmann::json summary_json(const RecordingSummary& recording) {
  return {{"name", recording.name},
          {"frames", recording.frames},
          {"events", recording.events},
          {"events_per_pixel_second", recording.events_per_pixel_second()},
          {"displacement_px", recording.displacement_px}};
}

}  // namespace

double RecordingSummary::events_per_pixel_second() const {
  const double pixel_seconds = static_cast<double>(pixels) * duration_s;
  return pixel_seconds > 0 ? static_cast<double>(events) / pixel_seconds : 0;
}

namespace {

Report table_of(const SimulationReport& report) {
  const RecordingSummary total = sum(report.made);
  return {
      {"event", "report"},
      {"made", json_list(report.made, summary_json),
       fmt::format("{:24} {:>8} {:>12} {:>10} {:>10}\n", "recording", "frames", "events",
                   "per px s", "px a frame") +
           joined(report.made, "", table_line)},
      {"total", summary_json(total), report.made.size() > 1 ? table_line(total) : ""},
      {"kept", report.kept},
      {"wall_seconds", report.wall_seconds},
      fmt::format("{} made, {} kept from earlier runs; {:.1f} s, {:.2f} s per frame",
                  count_text(std::ssize(report.made), "recording"), report.kept.size(),
                  report.wall_seconds,
                  total.frames > 0 ? report.wall_seconds / static_cast<double>(total.frames) : 0),
      {"folder", report.folder, report.folder}};
}

}  // namespace

std::string to_text(const SimulationReport& report) { return text_of(table_of(report)); }
std::string to_json(const SimulationReport& report) { return json_text_of(table_of(report)); }

}  // namespace eventgan

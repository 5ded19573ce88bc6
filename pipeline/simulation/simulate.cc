#include "pipeline/simulation/simulate.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <chrono>
#include <mutex>
#include <vector>

#include "pipeline/simulation/affine_scene.h"
#include "pipeline/simulation/clip_frames.h"
#include "pipeline/simulation/clip_scene.h"
#include "pipeline/simulation/record.h"
#include "pipeline/simulation/recording_plan.h"
#include "pipeline/simulation/recording_settings.h"
#include "pipeline/threads/thread_count.h"
#include "stages/files/unfinished_files.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A source, its clip, and the recordings of it that are to be made.
struct SourceWork {
  const SimulationSource* source = nullptr;
  std::unique_ptr<ClipFrames> clip;
  std::vector<PlannedRecording> to_do;
  std::vector<RecordingSummary> made;
};

/// Opens every source's clip and leaves out the recordings that are there.
std::vector<SourceWork> plan_work(const SimulationManifest& manifest, const fs::path& folder,
                                  bool overwrite, std::vector<std::string>& kept) {
  std::vector<SourceWork> works;
  for (const SimulationSource& source : manifest.sources) {
    SourceWork work{&source, std::make_unique<ClipFrames>(source, manifest), {}, {}};
    for (PlannedRecording& recording : plan_recordings(manifest, source, *work.clip, folder)) {
      const auto found = overwrite ? std::nullopt : settings_on_disk(recording.file);
      if (!found) {
        work.to_do.push_back(std::move(recording));
        continue;
      }
      check_same_settings(recording.file, *found, recording.settings);
      kept.push_back(recording.name);
    }
    works.push_back(std::move(work));
  }
  return works;
}

std::unique_ptr<Scene> make_scene(const SimulationSource& source, ClipFrames& clip,
                                  const PlannedRecording& recording, CounterRandom random) {
  switch (source.method) {
    case SimulationMethod::kClip:
      return std::make_unique<ClipScene>(clip, ClipMotion::kFlow);
    case SimulationMethod::kDifference:
      return std::make_unique<ClipScene>(clip, ClipMotion::kFade);
    case SimulationMethod::kAffine:
      break;
  }
  GreyImage picture = clip.frame(recording.picture.value());
  const int frames = source.frames_per_picture;
  const double a_frame_px = source.max_displacement_px * random.keyed("displacement").uniform(0);
  const AffineMotion motion =
      random_affine_motion(picture.size, a_frame_px * frames, random.keyed("motion"));
  return std::make_unique<AffineScene>(std::move(picture), motion, frames, 1 / clip.rate_hz());
}

std::int64_t frame_total(const std::vector<SourceWork>& works) {
  std::int64_t frames = 0;
  for (const SourceWork& work : works) {
    for (const PlannedRecording& recording : work.to_do) frames += recording.frame_count;
  }
  return frames;
}

void run(SourceWork& work, const SimulationManifest& manifest,
         const std::function<void()>& on_frame) {
  for (const PlannedRecording& recording : work.to_do) {
    const CounterRandom random = CounterRandom(manifest.seed).keyed(recording.name);
    const auto scene = make_scene(*work.source, *work.clip, recording, random);
    work.made.push_back(record(*scene, manifest.sensor, random.keyed("sensor"), recording.file,
                               recording.settings, on_frame));
  }
}

}  // namespace

SimulationReport simulate(const SimulationManifest& manifest, const SimulationOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const fs::path folder = options.output.value_or(resolve(manifest, manifest.output_directory));
  SimulationReport report;
  report.folder = folder.string();
  fs::create_directories(folder);
  remove_stale_temporaries(folder);
  std::vector<SourceWork> works = plan_work(manifest, folder, options.overwrite, report.kept);

  const std::int64_t frames = frame_total(works);
  const std::unique_ptr<Progress> progress =
      options.make_progress && frames > 0 ? options.make_progress(frames) : nullptr;
  std::mutex showing;
  const auto on_frame = [&] {
    if (!progress) return;
    const std::lock_guard lock(showing);
    progress->advance(/*quarantined=*/false, /*bytes=*/0);
  };
  const int threads = thread_count(options.threads);
  const tbb::global_control budget(tbb::global_control::max_allowed_parallelism,
                                   static_cast<std::size_t>(threads));
  tbb::task_arena(threads).execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, works.size(), 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            run(works[i], manifest, on_frame);
          }
        },
        tbb::simple_partitioner());
  });
  if (progress) progress->finish();

  for (const SourceWork& work : works) {
    report.made.insert(report.made.end(), work.made.begin(), work.made.end());
  }
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan

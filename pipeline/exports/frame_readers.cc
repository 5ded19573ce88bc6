#include "pipeline/exports/detail/frame_readers.h"

#include <utility>

#include "pipeline/folder/output_folder.h"

namespace eventgan {

struct FrameReaders::Reader {
  explicit Reader(const std::filesystem::path& base) : samples(base, warnings) {}

  std::vector<std::string> warnings;
  PreviewReader samples;
};

FrameReaders::FrameReaders(const ExportInput& input, const ExportOptions& options)
    : folder_(input.folder()),
      given_(options.frames.empty() ? options.frames
                                    : std::filesystem::absolute(options.frames / "")),
      base_(given_.empty() ? recorded_manifest_folder(folder_).value_or(folder_) : given_) {}
FrameReaders::~FrameReaders() = default;

std::string FrameReaders::settings() const {
  return given_.empty() ? "" : "frames " + given_.lexically_normal().string() + "\n";
}

Outcome<SampleFrames> FrameReaders::try_frames(const OutgoingSample& sample, bool with_labelled) {
  std::unique_ptr<Reader> reader;
  {
    const std::lock_guard lock(mutex_);
    if (!free_.empty()) {
      reader = std::move(free_.back());
      free_.pop_back();
    }
  }
  if (!reader) reader = std::make_unique<Reader>(base_);
  SampleFrames frames =
      reader->samples.frames(folder_ / sample.shard.outline.name, sample.slot, with_labelled);
  if (!reader->warnings.empty()) return SampleFault{reader->warnings.front()};
  const std::lock_guard lock(mutex_);
  free_.push_back(std::move(reader));
  return frames;
}

SampleFrames FrameReaders::frames(const OutgoingSample& sample, bool with_labelled) {
  Outcome<SampleFrames> frames = try_frames(sample, with_labelled);
  if (!is_fault(frames)) return *std::move(frames);
  throw InputError(frames.fault().reason +
                   " (--frames names the folder that frame paths start at, with --overwrite; --to "
                   "raw goes without frames)");
}

}  // namespace eventgan

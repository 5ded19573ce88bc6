#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/exporter.h"
#include "pipeline/preview/preview_reader.h"

namespace eventgan {

/// Reads samples' frames as previews show them, where `convert` found them, or relative to
/// ExportOptions::frames; as many shards are open as threads read at once. Thread safe.
class FrameReaders {
 public:
  FrameReaders(const ExportInput& input, const ExportOptions& options);
  ~FrameReaders();

  /// A line for the export's identity: where frames are, if an option says.
  std::string settings() const;

  /// A fault names the first frame that cannot be read. Throws as PreviewReader does.
  Outcome<SampleFrames> try_frames(const OutgoingSample& sample, bool with_labelled);

  /// The same; throws InputError for a frame that cannot be read.
  SampleFrames frames(const OutgoingSample& sample, bool with_labelled);

 private:
  struct Reader;

  std::filesystem::path folder_;  ///< of the shards
  std::filesystem::path given_;   ///< the option's, absolute; else empty
  std::filesystem::path base_;    ///< where relative frame paths start
  std::mutex mutex_;
  std::vector<std::unique_ptr<Reader>> free_;
};

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"
#include "stages/frames/decoding/cut_out.h"

namespace eventgan {

struct OutlineMasksOptions {
  std::filesystem::path out;  ///< folder for the masks, made if absent
  int threads = 0;            ///< 0: all cores
  /// Called with the number of masks to make, if there are any; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
  std::function<bool()> stop = {};  ///< asked before each image; none: nobody asks
};

/// What was made of a manifest's images.
struct OutlineMasksReport {
  /// Of a source of frames, where its masks are: SourceSpec::outlines as the manifest may name it.
  struct Source {
    std::string root;
    std::string outlines;
  };
  std::vector<Source> sources;
  std::int64_t images = 0;  ///< labelled ones
  std::int64_t made = 0;
  std::int64_t kept = 0;                 ///< that were there
  OutlineCounts outlines;                ///< of those made
  std::vector<std::string> of_ellipses;  ///< masks with ellipses, in the order of the images
  std::vector<std::string> faults;       ///< "expected X, got Y, in PATH (ID)", likewise

  bool complete() const { return made + kept + std::ssize(faults) == images; }
};

/// A few lines for a person.
std::string to_text(const OutlineMasksReport& report);

/// One line of JSON.
std::string to_json(const OutlineMasksReport& report);

/// Writes an index mask for each labelled image of the manifest's sources of frames: 0 is
/// background, k the k-th box of its annotation (encode_index_png). Outlines that labels have are
/// drawn as they are, other boxes are cut out (cut_out.h), regions to be ignored are not drawn;
/// where two objects overlap, the pixels are that one's whose box ends lower in the image, since it
/// stands nearer.
///
/// A mask that is there stays as it is, so that the work can be stopped and gone on with, and what
/// a person has mended is not lost; each appears whole. Of several sources, each has a folder of
/// its own in `out`, named as its root. What is written does not depend on the threads.
///
/// Throws UsageError if the manifest has no source of frames, what open_dataset and select_frames
/// throw, and std::system_error if the disk fails.
OutlineMasksReport make_outline_masks(const JobManifest& manifest,
                                      const OutlineMasksOptions& options);

/// Why the masks of a source (SourceSpec::outlines) are not those of the objects in its boxes, as
/// far as some images tell; empty if they are: those of most images can be read, what is around
/// their objects is about the boxes, and where there are several boxes a mask has several objects.
std::string masks_fault(SourceSpec spec, const std::filesystem::path& folder);

}  // namespace eventgan

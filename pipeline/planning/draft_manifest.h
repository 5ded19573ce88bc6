#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stages/frames/sources/find_source.h"

namespace eventgan {

/// A manifest for datasets that were found, and what a person should know of them.
struct ManifestDraft {
  std::string text;  ///< the manifest, with comments
  /// What was found, what is missing, what was decided, and what speaks against it
  /// ("warning: ..."), a line each; of several sources, each one's begin with its root.
  std::vector<std::string> findings;
  std::vector<std::string> notes;  ///< Dataset::notes()
  bool has_samples = false;        ///< each source has labelled frames that make pairs, or windows
  bool needs_sensor = false;       ///< a recording's files do not give the sensor's size
};

/// Whether the camera moves before which photographs of labelled objects are to be seen
/// (manifests/guides/choose.md).
enum class CameraMotion { kRests, kMoves, kBoth };

/// What somebody wants of a manifest beyond what is found.
struct DraftWishes {
  std::optional<CameraMotion> camera = {};
  std::vector<std::string> classes = {};  ///< SourceSpec::classes of each source; empty: all
  bool no_labels = false;                 ///< the sources went without them (go_without_labels)
};

/// StillsSpec::rests of photographs of labelled objects before such a camera.
double rests_of(CameraMotion camera);

/// Where a manifest will lie, and what it says of places.
struct DraftPlace {
  std::filesystem::path folder;
  bool is_relative = false;  ///< sources' paths start at `folder`, else they are absolute
  std::string output;        ///< output.directory
};

/// A name for the job of these sources, a part of its files' names and its folder: after the folder
/// or video that was found or, of several in one folder, after that; "kitti-events".
std::string draft_name(const std::vector<FoundSource>& sources);

/// Opens the datasets, counts their labelled frames and the paired frames of these, and writes one
/// manifest for all: gaps, size and preset as manifests/examples have them, gaps without any paired
/// frame left out. Where images are no sequence, since some that are looked at have several sizes,
/// or neighbours that do not show the same scene, or where no labelled frame has a paired frame,
/// each image makes a pair with itself ("from": "stills"). Of sources that want different sizes, it
/// is one that fits all. Photographs of driving scenes, as their folders' names tell, never
/// rest and are the network's, by its narrow weights, unless `wishes` names a camera. What it reads
/// is what `convert` would read by the manifest. Generated volumes are of the cheapest weights and
/// precision that teach a detector no less: int8 where this processor has instructions for it, else
/// "auto"; and of what moves alone where that saves a tenth of the network's work or more
/// (SeenMotion).
///
/// Throws as open_dataset does, and UsageError for a path that is not UTF-8, which no manifest can
/// name, for a source that is given twice, and for recordings of events beside frames, which make
/// no job together.
ManifestDraft draft_manifest(const std::vector<FoundSource>& sources, const DraftPlace& place,
                             const DraftWishes& wishes = {});

}  // namespace eventgan

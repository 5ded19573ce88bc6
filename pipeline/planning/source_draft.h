#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/sources/find_source.h"

namespace eventgan {

/// A sensor that the events of a recording fit on.
struct SensorGuess {
  ImageSize size;
  int x = 0, y = 0;  ///< the largest of an event
};

/// Base width of the weights that are as good for detectors and poses as wide ones.
inline constexpr int kNarrowWeights = 8;

/// Whether int8 is worth its error here, with shipped weights of this base width: less than 1.3
/// times float32's speed is not, and `convert`, which measures anew and warns where int8 is the
/// slower one, could see it the other way round. As int8_speedup otherwise.
bool int8_pays(int base_width);

/// What moves in some pairs of a source, spread over its sequences, as Scope::kMotion sees it.
struct SeenMotion {
  int pairs = 0;    ///< that were looked at
  int resting = 0;  ///< of them those of whose tiles at most half move: the image rests
  // Means of the pairs; 1 of none, and of stills:
  double tiles = 1;  ///< share of the tiles that move
  double work = 1;   ///< share of the narrow network's work that these take (tiles_work)
};

/// What is known of a source when its part of a manifest is written.
struct SourceDraft {
  explicit SourceDraft(const FoundSource& source);

  FoundSource found;
  const DraftHabits& habits;               ///< of its dataset
  std::vector<int> gaps = {};              ///< to take pairs of; at first those of `habits`
  std::string preset = {};                 ///< ImageSpec::preset of it alone; empty of events
  std::vector<std::string> findings = {};  ///< as ManifestDraft has them
  std::vector<std::string> notes = {};     ///< Dataset::notes()
  bool is_stills = false;
  bool has_sizes = false;                 ///< the images that were looked at have several sizes
  ImageSize usual_size = {};              ///< of these the middle one
  bool has_frames = false;                ///< recording
  bool are_windows = false;               ///< recordings, each a labelled window of its own
  bool needs_sensor = false;              ///< recording whose files do not tell the sensor's size
  std::optional<SensorGuess> guess = {};  ///< then: what the events show, if any was seen
  bool has_samples = false;               ///< labelled frames that make pairs, or windows
  std::optional<ValueRange> range = {};   ///< of images of 16 bits that use little of them
  std::int64_t labelled_frames = 0;
  SeenMotion motion = {};
};

/// Opens the dataset of `spec`, which a manifest in `folder` has for it, counts its labelled frames
/// and their paired frames, and looks at some images, prepared as `image` says: do neighbours show
/// the same scene, or does each image make a pair with itself? How much of the pairs moves? What
/// cannot be read is passed over. Throws as open_dataset does.
void look_at_source(const SourceSpec& spec, const ImageSpec& image,
                    const std::filesystem::path& folder, SourceDraft& draft);

}  // namespace eventgan

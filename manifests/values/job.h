#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/datasets.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/generators.h"

namespace eventgan {

/// Where a manifest came from; every kind of manifest has it.
struct ManifestOrigin {
  /// The manifest file, byte for byte; or, if it names a sensor's document, as JSON that holds this
  /// document in place of its name, and no comments.
  std::string text;
  std::filesystem::path directory;  ///< absolute folder of the manifest; relative paths start here
};

/// `path` as the program must open it: below the manifest's folder unless it is absolute.
inline std::filesystem::path resolve(const ManifestOrigin& manifest, const std::string& path) {
  return manifest.directory / path;
}

/// In which numbers the network's convolutions are computed. The volume is float32 always.
enum class Precision {
  kFloat32,
  kBfloat16,  ///< activations and weights bfloat16, sums float32
  kInt8       ///< activations uint8, weights int8, sums int32; needs a calibration
};

/// What computes the network.
enum class Engine { kTorch, kOnednn };

/// Where the network is computed.
enum class Device {
  kCpu,
  kCuda  ///< the first CUDA device that LibTorch sees; kTorch alone
};

/// The manifest's words for these values.
std::string_view to_string(Precision precision);
std::string_view to_string(Engine engine);
std::string_view to_string(Device device);

/// How the Human3.6M source is laid out on disk (manifests/guides/datasets.md).
enum class Human36mLayout { kFetch, kExtracted, kOfficial };

/// Where the labelled frame lies in its pair: at the end, at the start, or in the middle.
enum class PairSide { kBefore, kAfter, kAround };

/// One pair a labelled frame, its gap drawn by the seed; or one pair for each gap.
enum class PairChoice { kOne, kAll };

/// How the objects of a still move on their own, each before the image's motion is added: drawn as
/// that is, about the centre of the object's box.
struct ObjectMotionSpec {
  std::array<double, 2> translation_px{0, 8};
  double rotation_deg = 3;
  double scale = 0.04;
  double rests = 0.2;  ///< share of the objects that have none, where the image moves; 0..1
};

/// Pairs of stills: an image, and itself under a small motion about its centre. The seed draws the
/// motion of each image: a shift in any direction, an angle and a scale factor, each uniformly.
struct StillsSpec {
  std::array<double, 2> translation_px{2, 8};  ///< least and most, pixels of the image, 0..100
  double rotation_deg = 2;                     ///< most, either way, 0..45
  double scale = 0.03;                         ///< most, larger or smaller: 1 ± scale, 0..0.5
  int frames = 1;                              ///< the pair's gap_frames, 1..6
  /// Of objects with an outline, their labels' or cut out of their boxes; none: they move as the
  /// image does.
  std::optional<ObjectMotionSpec> objects = std::nullopt;
  /// Share of the pairs whose image does not move, 0..1; none: 0.5 with `objects`, else 0.
  std::optional<double> rests = std::nullopt;
};

struct PairSpec {
  std::vector<int> gaps;  ///< 1..6, ascending, distinct; even only with kAround; of stills `frames`
  PairSide side = PairSide::kBefore;
  PairChoice choose = PairChoice::kOne;
  std::int64_t min_pairs = 1;  ///< fewer pairs than this from the source is an error
  /// Frames farther apart in time than this are not paired; > 0. Where times are unknown, and
  /// without it, all are.
  std::optional<double> max_gap_s = std::nullopt;
  /// Pairs of single images, with kBefore or kAfter and kOne; none: of two frames of a sequence.
  std::optional<StillsSpec> stills = std::nullopt;
  /// With `stills`: each becomes a clip of so many labelled frames, 2..1000, made when they are
  /// read, whose pairs are of frames that follow each other.
  std::optional<int> clip_frames = std::nullopt;
};

/// Labels of one's own for the images or videos of a `frames` source.
struct LabelSpec {
  LabelFormat format = LabelFormat::kCoco;
  std::string path;  ///< file or folder, as written in the manifest
  /// voc, mot: what number the image's left and top edge has, 0 or 1; none: what the files tell.
  std::optional<int> edges_from = std::nullopt;
};

/// Which fields of a table of events are what: names of a header, of a structured array's fields,
/// or of an archive's arrays.
struct EventFields {
  std::string t = "t";
  std::string x = "x";
  std::string y = "y";
  std::string p = "p";
  /// What `t` counts: 1, 1e-3, 1e-6 or 1e-9 s; none: what its name and the times tell.
  std::optional<double> tick_s = {};
  bool operator==(const EventFields&) const = default;
};

/// What a recording of events does not tell of itself; which counts, its format's row says.
struct RecordingOptions {
  std::string camera = "left";           ///< "left" or "right", of two
  bool rectify = false;                  ///< events through a map of the lens
  std::optional<ImageSize> sensor = {};  ///< none: what the file tells
  std::optional<int> stream = {};        ///< of events, by its number; none: the first
  bool time_shift = true;                ///< times count from the recording's start
  EventFields columns = {};
  bool operator==(const RecordingOptions&) const = default;
};

/// Which labelled frames of a dataset are taken: those for which all of it holds.
struct SelectionSpec {
  std::optional<std::string> ids;  ///< a text file, as written in the manifest: a sample_id a line
  std::vector<std::string> subjects, cameras, actions;  ///< human36m: one of these; empty: any
  std::vector<std::string> without_actions;             ///< dhp19: none of these
  /// Sequences (human36m: subject and action; frames without: sample_id) whose number in [0, 1),
  /// which the seed gives them, lies in [first, last): [0, 0.8] and [0.8, 1] share no sequence.
  std::array<double, 2> fraction{0, 1};
};

/// One dataset on disk. Paths are as written in the manifest.
struct SourceSpec {
  DatasetKind dataset = DatasetKind::kFrames;
  int every = 1;  ///< human36m, official: takes one of so many frames, 1..1000; a gap counts these
  std::string root;
  std::string split = "train";          ///< part of file names, as JobManifest::name
  std::optional<std::string> raw_root;  ///< kitti_object: KITTI raw, for gaps 4-6
  std::optional<std::string> devkit;    ///< kitti_object: object devkit, whose mapping leads to raw
  std::optional<std::string>
      annotations;  ///< mpii, mpii_list, human36m: the annotation file or folder
  std::optional<std::string> sequences;      ///< mpii, mpii_list: the folder of video frames
  std::optional<Human36mLayout> layout;      ///< human36m only, and required there
  std::optional<double> frames_per_second;   ///< frames: for gap_s where the files do not tell
  std::optional<LabelSpec> labels;           ///< frames
  std::optional<std::string> outlines = {};  ///< of frames: folder of index masks
  std::vector<std::string> classes = {};     ///< takes only boxes of these; empty: of all
  SelectionSpec selection;
  PairSpec pairs;
  bool flow = false;           ///< samples have their ShardSample::flow
  RecordingOptions recording;  ///< recording
  WindowSpec window;           ///< of events: in place of `pairs`
};

/// Whether its frames have labels, as far as the manifest tells: images of one's own may have none.
inline bool has_labels(const SourceSpec& spec) {
  return !is_own(spec.dataset) || spec.labels.has_value() || spec.flow;
}

enum class ImageFit { kStretch, kLetterbox, kCrop };

/// Whether the image is made grey before or after it is resized.
enum class GreyOrder { kBeforeResize, kAfterResize };

/// How a frame becomes the network's input. Presets: kitti = grey before
/// resizing and a 3x3 blur; mpii = grey before resizing, no blur; demo = grey after resizing, no
/// blur. A manifest names one, gives both `grey` and `blur`, or takes that of its datasets.
struct ImageSpec {
  std::optional<ImageSize> size;  ///< sides 16..8192; none: every image keeps its own size
  ImageFit fit = ImageFit::kStretch;
  std::string preset;  ///< "kitti", "mpii", "demo", or empty when the keys were given one by one
  GreyOrder grey = GreyOrder::kBeforeResize;
  int blur = 0;                     ///< side of the Gaussian kernel in pixels, odd, 3..31; 0 = none
  std::optional<ValueRange> range;  ///< of images of 16 bits; none: their upper 8 bits are taken
};

/// Which part of a volume is generated; the rest is zeros.
enum class Scope {
  kWhole,
  kMotion,     ///< where the two frames differ
  kLabels,     ///< there, and around labelled boxes and persons
  kLabelsOnly  ///< around these alone
};

/// A tile is generated if one of its pixels is wanted.
struct ScopeSpec {
  Scope scope = Scope::kWhole;
  double motion_threshold = 6;  ///< of the smoothed difference of two frames, grey levels, 0..255
  int motion_margin_px = 4;     ///< wanted around a pixel that differs by more, 0..64
  int label_margin_px = 16;     ///< wanted around a box or a person's crop, 0..1024
  int tile_px = 16;             ///< side of a tile, 8..128
};

struct GeneratorSpec {
  GeneratorKind kind = GeneratorKind::kNetwork;
  /// kNetwork: path of a .safetensors file, "shipped", "shipped:WIDTH" or "shipped:sensor"
  /// (manifests/weights), or "untrained:WIDTH", WIDTH 1..64.
  std::string weights = "shipped";
  /// kNetwork: none ("auto") means the fastest one for the precision on the processor that runs it.
  std::optional<Engine> engine;
  Device device = Device::kCpu;  ///< kNetwork
  /// kNetwork: none ("auto") means what the processor that runs it does well.
  std::optional<Precision> precision = Precision::kFloat32;
  ScopeSpec scope;     ///< kNetwork
  bool sample = true;  ///< kNetwork: events are drawn of rates, if the weights give rates
  SensorSpec sensor;   ///< kEsim, kDifference; at the middle of `threshold`
  std::string camera;  ///< name of the document that `threshold` and `noise` are of; empty: none
  std::optional<ThresholdSpec> threshold = {};  ///< of any kind but kEvents (pair_threshold)
  /// SHA-256 of the weights that `threshold` is of, as `camera` says; empty: of any.
  std::string threshold_weights;
  std::optional<NoiseSpec> noise = {};  ///< of any kind but kEvents
  double duration_s = 0.1;          ///< time between the two frames, 1e-4..10. kEsim, kDifference:
                                    ///< for the sensor. `noise`: of pairs whose times are unknown
  double max_displacement_px = 10;  ///< kEsim: of the random motion, 0.1..100
};

enum class Normalization { kNone, kEta98 };

struct VolumeSpec {
  int bins = 9;  ///< 1..64
  Normalization normalize = Normalization::kNone;
};

enum class StoredType { kFloat32, kFloat16, kUint8 };

struct OutputSpec {
  std::string directory;
  /// 1..65536; none: 8 to 64, by what a sample costs (samples_per_shard in make_plan.h)
  std::optional<int> samples_per_shard;
  StoredType dtype = StoredType::kFloat16;
  int deflate_level = 1;  ///< 0..9
};

/// Bytes of one stored value.
std::size_t stored_size(StoredType type);

enum class ErrorPolicy { kFail, kQuarantine };

struct ErrorSpec {
  ErrorPolicy policy = ErrorPolicy::kQuarantine;
  std::int64_t max_count = 100;  ///< ≥ 0
  double max_fraction = 0.01;    ///< 0..1
};

/// A conversion job, as manifests/schemas/manifest.schema.json describes it.
struct JobManifest : ManifestOrigin {
  /// Part of file names: 1..64 of A-Z a-z 0-9 . _ - and neither "." nor "-" first.
  std::string name;
  std::uint64_t seed = 0;  ///< 0..2^63-1
  std::vector<SourceSpec> sources;
  ImageSpec image;
  GeneratorSpec generator;
  VolumeSpec volume;
  OutputSpec output;
  ErrorSpec errors;
};

/// The manifest's words for these values, and back into text for shards, plans and reports.
std::string_view to_string(DatasetKind kind);
std::string_view to_string(Human36mLayout layout);
std::string_view to_string(LabelFormat format);
std::string_view to_string(PairSide side);
std::string_view to_string(PairChoice choice);
std::string_view to_string(LabelPlace place);
std::string_view to_string(ImageFit fit);
std::string_view to_string(GreyOrder order);
std::string_view to_string(GeneratorKind kind);
std::string_view to_string(Scope scope);
std::string_view to_string(Normalization normalization);
std::string_view to_string(StoredType type);
std::string_view to_string(ErrorPolicy policy);

/// How many of a plan's samples may be quarantined: max_count, or max_fraction of them, whichever
/// is less. Of 2 to 99 samples one may be, unless max_count or max_fraction is 0.
std::int64_t most_quarantined(const ErrorSpec& errors, std::int64_t planned);

/// True if so many of a plan's samples are quarantined that its error policy calls the run failed.
bool beyond_limits(const ErrorSpec& errors, std::int64_t quarantined, std::int64_t planned);

/// What the policy allows, for "expected ..., got ...".
std::string limits_text(const ErrorSpec& errors, std::int64_t planned);

}  // namespace eventgan

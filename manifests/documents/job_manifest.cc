#include "manifests/documents/job_manifest.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "manifests/documents/detail/job_manifest.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/detail/sensor_document.h"
#include "manifests/documents/detail/strict_json.h"
#include "manifests/documents/sensor_document.h"
#include "manifests/values/job.h"
#include "manifests/values/words.h"

namespace eventgan {

std::vector<int> read_gaps(const StrictValue& value, PairSide side) {
  std::vector<int> gaps;
  for (const StrictValue& element : value.elements(1)) {
    const auto gap = element.sound_integer(1, 6);
    if (!gap) continue;
    if (side == PairSide::kAround && *gap % 2 != 0) {
      element.fault("an even gap (2, 4 or 6), since side is \"around\"");
    }
    if (std::find(gaps.begin(), gaps.end(), *gap) != gaps.end()) element.fault("each gap once");
    gaps.push_back(static_cast<int>(*gap));
  }
  std::sort(gaps.begin(), gaps.end());
  return gaps;
}

std::array<double, 2> read_ends(const StrictValue& value, double lowest, double highest) {
  const std::vector<StrictValue> ends = value.elements(2);
  if (ends.size() != 2) {
    if (!ends.empty()) value.fault("an array of 2");
    return {lowest, lowest};
  }
  const std::array<double, 2> range{ends[0].number(lowest, highest),
                                    ends[1].number(lowest, highest)};
  if (range[1] < range[0]) ends[1].fault("a number not below the previous one");
  return range;
}

namespace {

StillsSpec read_motion(const StrictValue& value) {
  constexpr double kFarthest_px = 100, kMost_deg = 45, kMostScale = 0.5;
  StillsSpec spec;
  StrictObject object = value.object();
  if (const auto range = object.find("translation_px")) {
    spec.translation_px = read_ends(*range, 0, kFarthest_px);
  }
  if (const auto angle = object.find("rotation_deg")) {
    spec.rotation_deg = angle->number(0, kMost_deg);
  }
  if (const auto scale = object.find("scale")) spec.scale = scale->number(0, kMostScale);
  if (const auto frames = object.find("frames")) spec.frames = frames->integer(1, 6);
  object.finish();
  return spec;
}

}  // namespace

PairSpec read_pairs(const StrictValue& value) {
  PairSpec spec;
  StrictObject object = value.object();
  if (const auto least = object.find("min_pairs")) {
    spec.min_pairs = least->integer<std::int64_t>(0, 1'000'000'000);
  }
  const auto side = object.find("side");
  if (side) spec.side = side->choice(kSideWords);
  const auto from = object.find("from");
  if (from && from->choice(kPairOriginWords)) {
    if (spec.side == PairSide::kAround)
      side->fault("\"before\" or \"after\", since from is \"stills\"");
    const auto motion = object.find("motion");
    spec.stills = motion ? read_motion(*motion) : StillsSpec();
    spec.gaps = {spec.stills->frames};
    for (const char* key : {"gaps", "choose", "max_gap_s"}) {
      if (const auto found = object.find(key))
        found->fault("no such key, since from is \"stills\"");
    }
    object.finish();
    return spec;
  }
  if (const auto motion = object.find("motion")) {
    motion->fault("no such key, since from is \"sequence\"");
  }
  if (const auto choose = object.find("choose")) spec.choose = choose->choice(kChoiceWords);
  if (const auto most = object.find("max_gap_s")) spec.max_gap_s = most->number(1e-6, 1e6);
  spec.gaps = read_gaps(object.at("gaps"), spec.side);
  object.finish();
  return spec;
}

namespace {

std::vector<std::string> read_words(const std::optional<StrictValue>& value) {
  std::vector<std::string> words;
  if (!value) return words;
  for (const StrictValue& element : value->elements(1)) words.push_back(element.text());
  return words;
}

/// A source's keys that not every kind of dataset takes.
class SourceKeys {
 public:
  /// `row`: none if the kind is faulty; then no key is out of place.
  SourceKeys(StrictObject& object, const DatasetRow* row) : object_(object), row_(row) {}

  /// The key's value if it is there, or must be. It is a fault where the kind does not take it.
  std::optional<StrictValue> find(std::string_view key) {
    if (row_ != nullptr && row_->required_key == key) return object_.at(key);
    std::vector<DatasetKind> owners;
    for (const DatasetRow& row : kDatasets) {
      if (takes(row, key)) owners.push_back(row.value);
    }
    const auto kind = row_ == nullptr ? std::nullopt : std::optional(row_->value);
    return SpecialKeys(object_, "dataset", kind).find(key, owners);
  }

  std::optional<std::string> find_path(std::string_view key) {
    const std::optional<StrictValue> value = find(key);
    return value ? std::optional(read_path(*value)) : std::nullopt;
  }

 private:
  StrictObject& object_;
  const DatasetRow* row_;
};

SelectionSpec read_selection(StrictObject& object, SourceKeys& keys) {
  SelectionSpec spec;
  if (const auto ids = object.find("ids")) spec.ids = read_path(*ids);
  spec.subjects = read_words(keys.find("subjects"));
  spec.cameras = read_words(keys.find("cameras"));
  spec.actions = read_words(keys.find("actions"));
  spec.without_actions = read_words(keys.find("without_actions"));
  if (const auto fraction = object.find("fraction")) {
    const auto ends = fraction->elements(2);
    if (ends.size() == 2) {
      spec.fraction = {ends[0].number(0, 1), ends[1].number(0, 1)};
      if (spec.fraction[1] <= spec.fraction[0]) ends[1].fault("a number above the previous one");
    } else if (!ends.empty()) {
      fraction->fault("an array of 2");
    }
  }
  return spec;
}

/// Reads what the source says of its windows, over what is usual.
WindowSpec read_window(SourceKeys& keys, WindowSpec spec) {
  const auto duration = keys.find("window_s");
  const auto events = keys.find("window_events");
  if (duration) spec.duration_s = duration->number(1e-6, 1e3);
  if (events) spec.events = events->integer<std::int64_t>(1, 1'000'000'000);
  if (duration && events) events->fault("no such key together with window_s, which sets it");
  if (const auto place = keys.find("label_at")) spec.label = place->choice(kLabelPlaceWords);
  return spec;
}

LabelSpec read_labels(const StrictValue& value) {
  LabelSpec spec;
  StrictObject object = value.object();
  spec.format = object.at("format").choice(kLabelFormatWords);
  spec.path = read_path(object.at("path"));
  if (const auto from = object.find("edges_from")) {
    spec.edges_from = from->integer(0, 1);
    if (spec.format != LabelFormat::kVoc && spec.format != LabelFormat::kMot) {
      from->fault("no such key for this format (only for voc and mot)");
    }
  }
  object.finish();
  return spec;
}

RecordingOptions read_recording_options(SourceKeys& keys) {
  constexpr int kLargestSensor = 8192;
  RecordingOptions options;
  if (const auto camera = keys.find("camera")) options.camera = read_stereo_camera(*camera);
  if (const auto rectify = keys.find("rectify")) options.rectify = rectify->boolean();
  if (const auto sensor = keys.find("sensor")) {
    options.sensor = read_size(*sensor, 1, kLargestSensor);
  }
  if (const auto columns = keys.find("columns")) options.columns = read_columns(*columns);
  return options;
}

}  // namespace

std::string read_stereo_camera(const StrictValue& value) {
  return value.text("\"left\" or \"right\"",
                    [](std::string_view text) { return text == "left" || text == "right"; });
}

ImageSize read_size(const StrictValue& value, int least, int most) {
  StrictObject object = value.object();
  const ImageSize size{object.at("height").integer(least, most),
                       object.at("width").integer(least, most)};
  object.finish();
  return size;
}

EventFields read_columns(const StrictValue& value) {
  EventFields columns;
  StrictObject object = value.object();
  const auto read = [&](const char* key, std::string& name) {
    if (const auto found = object.find(key)) name = found->text();
  };
  read("t", columns.t);
  read("x", columns.x);
  read("y", columns.y);
  read("p", columns.p);
  if (const auto unit = object.find("unit")) columns.tick_s = unit->choice(kTimeUnitWords);
  object.finish();
  return columns;
}

SourceSpec read_source(const StrictValue& value) {
  SourceSpec spec;
  StrictObject object = value.object();
  const auto dataset = object.at("dataset").sound_choice(kDatasetWords);
  spec.dataset = dataset.value_or(spec.dataset);
  spec.root = read_path(object.at("root"));
  if (const auto split = object.find("split")) spec.split = read_name(*split);

  const DatasetRow* const row = dataset ? &dataset_row(*dataset) : nullptr;
  SourceKeys keys(object, row);
  spec.raw_root = keys.find_path("raw_root");
  spec.devkit = keys.find_path("devkit");
  // Neither is of use without the other: the devkit's mapping says which raw frame an image is.
  if (spec.raw_root && !spec.devkit) object.at("devkit").fault("a path, since raw_root is given");
  spec.annotations = keys.find_path("annotations");
  spec.sequences = keys.find_path("sequences");
  if (const auto layout = keys.find("layout")) spec.layout = layout->choice(kLayoutWords);
  if (const auto every = keys.find("every")) {
    spec.every = every->integer(1, 1000);
    if (spec.layout != Human36mLayout::kOfficial) {
      every->fault("no such key for this layout (only for official)");
    }
  }
  if (const auto rate = keys.find("frames_per_second")) {
    spec.frames_per_second = rate->number(1e-6, 1e6);
  }

  if (const auto labels = keys.find("labels")) spec.labels = read_labels(*labels);
  spec.recording = read_recording_options(keys);

  spec.selection = read_selection(object, keys);
  spec.window = read_window(keys, row == nullptr ? WindowSpec() : row->window);
  if (row == nullptr || !row->has_events) {
    spec.pairs = read_pairs(object.at("pairs"));
  } else if (const auto pairs = object.find("pairs")) {
    pairs->fault("no such key for dataset \"" + std::string(row->word) +
                 "\", whose samples are windows of events");
  }
  object.finish();
  return spec;
}

namespace {

// Below 16 pixels a side the network's four halvings leave less than one pixel of the image at
// its bottom; above 8192 no camera of these datasets goes, so that a larger number is a slip.
constexpr int kSmallestSide = 16;
constexpr int kLargestSide = 8192;

struct Preset {
  std::string_view name;
  GreyOrder grey;
  int blur;
};

// As the published scripts for KITTI, for MPII and Human3.6M, and for the demo.
constexpr Preset kKitti{"kitti", GreyOrder::kBeforeResize, 3};
constexpr Preset kMpii{"mpii", GreyOrder::kBeforeResize, 0};
constexpr Preset kDemo{"demo", GreyOrder::kAfterResize, 0};
constexpr std::array kPresetWords{Word<Preset>{kKitti.name, kKitti},
                                  Word<Preset>{kMpii.name, kMpii}, Word<Preset>{kDemo.name, kDemo}};

/// The preset of that name; one without a name if there is none.
Preset preset_named(std::string_view name) {
  const auto preset = std::ranges::find(kPresetWords, name, &Word<Preset>::word);
  return preset == kPresetWords.end() ? Preset{"", GreyOrder::kBeforeResize, 0} : preset->value;
}

/// The preset of the sources' datasets. A job has one preprocessing: where they differ, that is a
/// fault of `preset`, which had to say which.
Preset default_preset(const std::vector<SourceSpec>& sources, StrictObject& image) {
  if (sources.empty()) return kKitti;  // a fault already
  const DatasetRow& first = dataset_row(sources.front().dataset);
  for (const SourceSpec& source : sources) {
    const DatasetRow& other = dataset_row(source.dataset);
    if (other.preset == first.preset) continue;
    const auto has = [](const DatasetRow& row) {
      return std::string(row.word) + " has \"" + std::string(row.preset) + "\"";
    };
    image.at("preset").fault("a preset, since " + has(first) + " and " + has(other));
    break;
  }
  return preset_named(first.preset);
}

int read_blur(const StrictValue& value) {
  const int blur = value.integer(0, 31);
  if (blur == 1 || (blur > 0 && blur % 2 == 0)) value.fault("0 (no blur) or an odd integer 3..31");
  return blur;
}

}  // namespace

ImageSpec read_image(const StrictValue& value, const std::vector<SourceSpec>& sources) {
  ImageSpec spec;
  StrictObject object = value.object();
  if (object.find("width") || object.find("height")) {
    spec.size = {object.at("height").integer(kSmallestSide, kLargestSide),
                 object.at("width").integer(kSmallestSide, kLargestSide)};
  }
  if (const auto fit = object.find("fit")) spec.fit = fit->choice(kFitWords);

  const auto preset = object.find("preset");
  const auto grey = object.find("grey");
  const auto blur = object.find("blur");
  if (!sources.empty() && std::ranges::all_of(sources, has_events, &SourceSpec::dataset)) {
    for (const auto& key : {preset, grey, blur}) {
      if (key) key->fault("no such key for events, which have no grey values");
    }
  } else if (preset || (!grey && !blur)) {
    const Preset chosen = preset ? preset->choice(kPresetWords) : default_preset(sources, object);
    spec.preset = chosen.name;
    spec.grey = chosen.grey;
    spec.blur = chosen.blur;
    if (grey) grey->fault("no such key together with a preset, which sets it");
    if (blur) blur->fault("no such key together with a preset, which sets it");
  } else {
    spec.grey = object.at("grey").choice(kGreyWords);
    spec.blur = read_blur(object.at("blur"));
  }
  object.finish();
  return spec;
}

namespace {

/// Events are the only volumes that a dataset of events can give, and no other dataset has them.
void check_kind(const JobManifest& manifest, const std::vector<StrictValue>& sources) {
  const bool wants_events = !needs_frames(manifest.generator.kind);
  std::string of_events;
  for (const DatasetRow& row : kDatasets) {
    if (row.has_events) of_events += (of_events.empty() ? "" : ", ") + std::string(row.word);
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const DatasetKind dataset = manifest.sources[i].dataset;
    if (has_events(dataset) == wants_events) continue;
    StrictObject source = sources[i].object();
    source.at("dataset").fault(
        wants_events ? "a dataset of events (" + of_events + "), since generator.kind is \"events\""
                     : "a dataset of frames, since generator.kind is not \"events\"");
  }
}

constexpr std::string_view kFormat = "eventgan-manifest";
constexpr int kVersion = 1;

VolumeSpec read_volume(const StrictValue& value) {
  VolumeSpec spec;
  StrictObject object = value.object();
  if (const auto bins = object.find("bins")) spec.bins = bins->integer(1, 64);
  if (const auto normalize = object.find("normalize")) {
    spec.normalize = normalize->choice(kNormalizationWords);
  }
  object.finish();
  return spec;
}

OutputSpec read_output(const StrictValue& value) {
  OutputSpec spec;
  StrictObject object = value.object();
  spec.directory = read_path(object.at("directory"));
  if (const auto count = object.find("samples_per_shard")) {
    spec.samples_per_shard = count->integer(1, 65536);
  }
  if (const auto dtype = object.find("dtype")) spec.dtype = dtype->choice(kStoredTypeWords);
  if (const auto level = object.find("deflate_level")) spec.deflate_level = level->integer(0, 9);
  object.finish();
  return spec;
}

ErrorSpec read_errors(const StrictValue& value) {
  ErrorSpec spec;
  StrictObject object = value.object();
  if (const auto policy = object.find("policy")) spec.policy = policy->choice(kPolicyWords);
  if (const auto count = object.find("max_count")) {
    spec.max_count = count->integer<std::int64_t>(0, 1'000'000'000);
  }
  if (const auto fraction = object.find("max_fraction")) {
    spec.max_fraction = fraction->number(0, 1);
  }
  object.finish();
  return spec;
}

/// A volume is one chunk of its shard, and HDF5's chunks stay below 4 GiB.
void check_chunk(const JobManifest& manifest, const StrictValue& image) {
  if (!manifest.image.size) return;
  const ImageSize size = *manifest.image.size;
  const std::uint64_t bytes = std::uint64_t{2} * manifest.volume.bins * size.pixel_count() *
                              stored_size(manifest.output.dtype);
  if (bytes <= std::numeric_limits<std::uint32_t>::max()) return;
  image.fault("volumes below 4 GiB (2 x bins x height x width x bytes of dtype)",
              std::to_string(bytes) + " bytes");
}

JobManifest read_job_document(const StrictValue& document) {
  JobManifest manifest;
  StrictObject object = document.object();
  if (!object.has_format(kFormat, kVersion)) return manifest;
  manifest.name = read_name(object.at("name"));
  if (const auto seed = object.find("seed")) manifest.seed = read_seed(*seed);
  const std::vector<StrictValue> sources = object.at("sources").elements(1);
  for (const StrictValue& source : sources) manifest.sources.push_back(read_source(source));
  const StrictValue image = object.at("image");
  manifest.image = read_image(image, manifest.sources);
  if (const auto generator = object.find("generator")) {
    manifest.generator = read_generator(*generator);
  }
  check_kind(manifest, sources);
  if (const auto volume = object.find("volume")) manifest.volume = read_volume(*volume);
  manifest.output = read_output(object.at("output"));
  if (const auto errors = object.find("errors")) manifest.errors = read_errors(*errors);
  object.finish();
  check_chunk(manifest, image);
  return manifest;
}

JobManifest read_pair_document(const StrictValue& document) {
  JobManifest manifest;
  StrictObject object = document.object();
  if (const auto seed = object.find("seed")) manifest.seed = read_seed(*seed);
  manifest.image.preset = kDemo.name;
  manifest.image.grey = kDemo.grey;
  if (const auto image = object.find("image")) {
    manifest.image = read_image(*image, {SourceSpec()});
  }
  if (const auto generator = object.find("generator")) {
    manifest.generator = read_generator(*generator);
    if (!needs_frames(manifest.generator.kind)) {
      generator->object().at("kind").fault("a generator that makes events of frames");
    }
    if (manifest.generator.device != Device::kCpu || manifest.generator.engine == Engine::kTorch) {
      generator->fault("the engine \"onednn\" on the device \"cpu\"");
    }
  }
  if (const auto volume = object.find("volume")) manifest.volume = read_volume(*volume);
  object.finish();
  return manifest;
}

}  // namespace

JobManifest parse_job_manifest(std::string_view text, const std::filesystem::path& directory,
                               const std::string& name) {
  return parse_manifest<JobManifest>(with_sensor_document(text, directory), directory, name,
                                     read_job_document);
}

JobManifest parse_pair_manifest(std::string_view text, const std::filesystem::path& directory,
                                const std::string& name) {
  return parse_manifest<JobManifest>(with_sensor_document(text, directory), directory, name,
                                     read_pair_document);
}

JobManifest read_job_manifest(const std::filesystem::path& file) {
  return parse_job_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan

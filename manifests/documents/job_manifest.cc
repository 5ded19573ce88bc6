#include "manifests/documents/job_manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/detail/sensor_document.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMostPairs = 1'000'000'000;
constexpr std::int64_t kMostEvents = 1'000'000'000;
constexpr int kLargestSensor = 8192;
constexpr int kMostStreams = 1'000'000;

void list_object_motion(Fields& fields, ObjectMotionSpec& spec) {
  fields.find("translation_px", spec.translation_px, pairs_of(0, 100),
              "Least and most length of an object's shift, in any direction.");
  fields.find("rotation_deg", spec.rotation_deg, numbers(0, 45),
              "Most, either way, about the centre of its box.");
  fields.find("scale", spec.scale, numbers(0, 0.5), "Most, larger or smaller.");
  fields.find(
      "rests", spec.rests, numbers(0, 1),
      "Share of the objects that have no motion of their own where the image moves, such as "
      "parked cars. Where it does not, every object moves.");
}

void list_motion(Fields& fields, StillsSpec& spec) {
  fields.find("translation_px", spec.translation_px, pairs_of(0, 100),
              "Least and most length of the shift, in any direction.");
  fields.find("rotation_deg", spec.rotation_deg, numbers(0, 45), "Most, either way.");
  fields.find("scale", spec.scale, numbers(0, 0.5),
              "Most, larger or smaller: 0.03 is 0.97 to 1.03.");
  fields.find("frames", spec.frames, integers(1, 6),
              "The gap of the pair, which the generator's training knows as so many frames.");
  fields.find(
      "objects", spec.objects, objects(list_object_motion),
      "gives each object a motion of its own, before the image's is added: nearer objects "
      "(whose boxes reach lower) cover farther ones, and what they uncover is filled from around "
      "it. One whose labels have no outline is cut out of its box. Without it everything moves as "
      "the image does.");
  fields.find("rests", spec.rests, numbers(0, 1),
              "Share of the pairs whose image does not move, as before a camera at rest; of those "
              "alone that have an object that does. Default: 0.5 with objects, else 0.");
}

void list_pairs(Fields& fields, PairSpec& spec) {
  bool of_stills = spec.stills.has_value();
  fields.kind(
      "from", of_stills, words(kPairOriginWords),
      "sequence: two frames of one sequence. stills: an image, and itself under a small "
      "motion that the seed draws; what moves is everything, as before a moving camera, and "
      "with motion.objects each object on its own.");
  Fields::Only stills = fields.only_for({"stills"}), sequences = fields.only_for({"sequence"});
  stills.find("motion", spec.stills, objects(list_motion),
              "the motion from the one image to the other, about the image's centre, in pixels of "
              "the image as stored. Each number is drawn uniformly.");
  stills.find("frames", spec.clip_frames, integers(2, 1000),
              "makes each image a sequence of so many labelled frames, frames_per_second apart (20 "
              "unless given), in which image and objects move on with the motion as that from one "
              "frame to the next.");
  const auto side =
      fields.find("side", spec.side, words(kSideWords),
                  "Where the pair lies. before: it ends with the labelled frame. after: it starts "
                  "with it. around: the labelled frame is in its middle; gaps must be even, and "
                  "from is sequence.");
  if (side && of_stills && spec.side == PairSide::kAround) {
    side->fault("\"before\" or \"after\", since from is \"stills\"");
  }
  fields.rule(R"({"if": {"required": ["side"], "properties": {"side": {"const": "around"}}},
                  "then": {"properties": {"from": {"const": "sequence"},
                                          "gaps": {"items": {"enum": [2, 4, 6]}}}}})");
  sequences.at("gaps", spec.gaps, Gaps{spec.side},
               "distances between the two frames of a pair, counted in stored frames.");
  sequences.find("choose", spec.choose, words(kChoiceWords),
                 "one pair for a labelled frame (one), its gap drawn by the seed, or a pair for "
                 "each gap (all).");
  sequences.find("max_gap_s", spec.max_gap_s, numbers(1e-6, 1e6),
                 "seconds from the first frame of a pair to the second at most; frames farther "
                 "apart are not paired, as beyond the sequence's end. Where stored frames lie at "
                 "irregular times (Human3.6M by h36m-fetch). Pairs whose times are unknown stay. "
                 "None unless given.");
  fields.find("min_pairs", spec.min_pairs, integers(0, kMostPairs),
              "Fewer pairs than this from the source are an error.");
  if (!of_stills) return;
  if (!spec.stills) spec.stills.emplace();
  spec.gaps = {spec.stills->frames};
}

void list_labels(Fields& fields, LabelSpec& spec) {
  fields.kind_at(
      "format", spec.format, words(kLabelFormatWords),
      "coco: JSON, instances or person keypoints. yolo: a folder of text files, data.yaml or "
      "classes.txt. voc: a folder of Pascal VOC's XML files. mot: gt.txt, or a folder of "
      "sequences with it. csv: a table image,class,left,top,right,bottom[,track]. masks: a folder "
      "of PNGs in which each pixel has the number of its object (Penn-Fudan, DAVIS, MOTS).");
  fields.at("path", spec.path, paths(), "The file or folder.");
  fields.only_for({LabelFormat::kVoc, LabelFormat::kMot})
      .find("edges_from", spec.edges_from, integers(0, 1),
            "the number of the image's left and top edge in the files. Default: what the files "
            "tell, which a note says.");
}

/// "none" says that what looks like labels is meant to be passed over.
struct LabelsOrNone {
  static constexpr auto list = list_labels;
  void read(const StrictValue& value, std::optional<LabelSpec>& member) const {
    if (value.is_text()) {
      value.text("\"none\", or an object", [](std::string_view text) { return text == "none"; });
    } else {
      objects(list).read(value, member.emplace());
    }
  }
  Schema schema(const std::optional<LabelSpec>&) const {
    return {{"anyOf", Schema::array({{{"const", "none"}}, objects(list).schema(LabelSpec())})}};
  }
  Schema json(const std::optional<LabelSpec>& member) const {
    return member ? objects(list).json(*member) : Schema();
  }
};

void list_columns(Fields& fields, EventFields& spec) {
  fields.find("t", spec.t, texts(),
              "Times. Of an array [N, 4] the number of the column, 0 to 3; by default 0.");
  fields.find("x", spec.x, texts(), "Columns of the sensor, from its left; by default 1.");
  fields.find("y", spec.y, texts(), "Rows of the sensor, from its top; by default 2.");
  fields.find("p", spec.p, texts(), "Polarities, 1 and 0 or 1 and -1; by default 3.");
  fields.find(
      "unit", spec.tick_s, words(kTimeUnitWords),
      "What the times count. Default: what the name's end says (_s, _ms, _us, _ns), else what "
      "makes a recording of the times; if two do, it must be given.");
}

/// What a recording of events does not tell of itself.
void list_recording(Fields::Only some, RecordingOptions& options) {
  some.find("camera", options.camera, stereo_cameras(),
            "of MVSEC's, DSEC's or M3ED's layout, which of its two.");
  some.find("rectify", options.rectify, booleans(),
            "of DSEC's layout, moves events by its rectify_map.h5.");
  some.find("sensor", options.sensor, sizes(1, kLargestSensor),
            "the camera's size in pixels. Default: what the file tells.");
  some.find("stream", options.stream, integers(0, kMostStreams),
            "of AEDAT, the number of its stream of events, by default the first; of a ROS bag, "
            "which of several topics of events, by name, from 0.");
  some.find("time_shift", options.time_shift, booleans(),
            "of Prophesee's RAW, takes the camera's time at the recording's start off all times, "
            "as Metavision's readers do. Labels made with these need it.");
  some.find("columns", options.columns, objects(list_columns),
            "of a table (.npy, .npz, .csv), the names of its columns, fields or arrays, and what "
            "its times count.");
}

/// Which labelled frames are taken.
void list_selection(Fields& fields, SelectionSpec& spec) {
  Fields::Only some = fields.taken_by(kDatasets);
  fields.find(
      "ids", spec.ids, paths(),
      "Takes only the labelled frames that this text file lists, a line each: the sample_id, or "
      "the path of the image.");
  some.find("subjects", spec.subjects, lists(texts(), 1),
            "takes only these subjects, such as S1. Default of dhp19: S1 to S12 for the split "
            "train, S13 to S17 for test, else all.");
  some.find("cameras", spec.cameras, lists(texts(), 1),
            "takes only these cameras, such as 54138969. Default of dhp19: 2 and 3.");
  some.find("actions", spec.actions, lists(texts(), 1),
            "takes only these actions, as the sequences name them: Directions-1 (fetch), "
            "Directions_1 (extracted), Directions 1 (official); dhp19: SESSION_MOVEMENT, such as "
            "1_3.");
  some.find("without_actions", spec.without_actions, lists(texts(), 1),
            "leaves out these movements, such as 2_1.");
  fields.find("fraction", spec.fraction, pairs_of(0, 1, Ends::kAbove),
              "Takes a part of the sequences: those whose number in [0, 1), which follows from "
              "seed and name, lies from the first up to the second. [0, 0.8] and [0.8, 1] share no "
              "sequence. Frames without a sequence count by themselves.");
}

/// Whether ground truth of flow may lie beside the frames: from an image to the one after it.
bool is_flow_pair(const SourceSpec& spec) {
  return spec.dataset == DatasetKind::kFrames && !spec.pairs.stills &&
         spec.pairs.side == PairSide::kAfter && spec.pairs.gaps == std::vector{1};
}

/// Flow is that of stills, or read.
void list_flow(Fields& fields, SourceSpec& spec, bool has_others) {
  const auto flow =
      fields
          .only_for(words_where(
              kDatasets, [](const DatasetRow& row) { return row.value != DatasetKind::kDhp19; }))
          .find("flow", spec.flow, booleans(),
                "writes how each pixel moves from the one image of its pair to the other, and "
                "where both show it: /labels/flow (manifests/guides/shard_format.md). Of stills it "
                "is exact; of frames (not with esim) and recordings it is the ground truth beside "
                "them (KITTI, DSEC, MVSEC).");
  fields.rule(R"({"if": {"required": ["flow"]},
                  "then": {"anyOf": [
                      {"required": ["pairs"], "properties": {"pairs": {
                          "required": ["from"], "properties": {"from": {"const": "stills"}}}}},
                      {"required": ["pairs"], "properties": {
                          "dataset": {"const": "frames"}, "pairs": {
                              "required": ["gaps", "side"],
                              "properties": {"gaps": {"const": [1]}, "side": {"const": "after"}}}}},
                      {"properties": {"dataset": {"const": "recording"}, "annotations": false,
                                      "window_s": false, "window_events": false,
                                      "label_at": false}}]}})");
  if (!flow || spec.pairs.stills) return;
  if (has_events(spec.dataset)) {
    if (has_others) {
      flow->fault("no such key beside annotations, window_s, window_events or label_at");
    }
  } else if (!is_flow_pair(spec)) {
    flow->fault(
        R"(no such key for these pairs (only from "stills", or of frames with gaps [1] and side "after"))");
  }
}

void list_source(Fields& fields, SourceSpec& spec) {
  fields.kind_at("dataset", spec.dataset, words(kDatasetWords),
                 "What kind of dataset it is, and so how its files lie.");
  if (fields.is_reading()) spec.window = dataset_row(spec.dataset).window;
  fields.at("root", spec.root, paths(),
            "The dataset's folder; for frames, a video, a folder of images, of such folders, or of "
            "videos; for recording, a recording, or a folder of them.");
  fields.find("split", spec.split, names(),
              "Name of the split that the source belongs to, a part of its shards' names.");
  Fields::Only some = fields.taken_by(kDatasets);
  some.find("raw_root", spec.raw_root, paths(),
            "the folder of KITTI raw, whose frames give gaps beyond the three previous frames.");
  some.find("devkit", spec.devkit, paths(),
            "the object development kit, whose mapping says which raw frame an image is. Alone it "
            "names the drives.");
  fields.needs("raw_root", "devkit");
  const auto annotations = some.find(
      "annotations", spec.annotations, paths(),
      "the annotation file or folder, if not in its usual place. mpii_list: the JSON list or "
      "HDF5 table. recording: the file of labels, or the folder of NAME.csv and "
      "NAME.json, if not beside the recording.");
  some.find("sequences", spec.sequences, paths(),
            "the folder of video frames around the annotated images.");
  some.find("layout", spec.layout, words(kLayoutWords),
            "as h36m-fetch unpacks the dataset (fetch), the pre-extracted images (extracted), or "
            "videos and .cdf files, as the dataset is downloaded (official).");
  const auto every = some.find("every", spec.every, integers(1, 1000),
                               "in the official layout, takes every so many frames of its videos, "
                               "from the first on. A gap counts the frames that are taken.");
  if (every && spec.layout != Human36mLayout::kOfficial) {
    every->fault("no such key for this layout (only for official)");
  }
  fields.rule(R"({"if": {"required": ["layout"], "properties": {"layout": {"const": "official"}}},
                  "else": {"properties": {"every": false}}})");
  some.find("frames_per_second", spec.frames_per_second, numbers(1e-6, 1e6),
            "the frame rate. Default: a video's own times; none for images.");
  some.find("labels", spec.labels, LabelsOrNone(),
            "labels of your own for the images or videos (manifests/guides/own_data.md); \"none\" "
            "says that there are none to read, as leaving the key out does.");
  Fields::Only of_frames = fields.only_for(
      words_where(kDatasets, [](const DatasetRow& row) { return !row.has_events; }));
  of_frames.find(
      "outlines", spec.outlines, paths(),
      "a folder of index masks, PATH.png of the image PATH.jpg below root: number k of a "
      "mask is the outline of the k-th box of the image's labels "
      "(manifests/guides/own_data.md).");
  fields.find("classes", spec.classes, lists(texts(), 1),
              "Takes only the boxes of these classes, which are numbered in this order. Boxes of "
              "others are left out and counted; KITTI's DontCare stays.");
  list_recording(some, spec.recording);
  list_selection(fields, spec.selection);
  const auto window_s = some.find(
      "window_s", spec.window.duration_s, numbers(1e-6, 1e3),
      "the events of so many seconds make a volume. Default: as long as the interval between "
      "frames that the label's time lies in.");
  const auto window_events = some.find(
      "window_events", spec.window.events, integers(1, kMostEvents),
      "so many events make a volume, in place of a time. dhp19: by default 7500, one window "
      "after the other.");
  fields.sets("window_s", {"window_events"});
  const auto label_at = some.find("label_at", spec.window.label, words(kLabelPlaceWords),
                                  "where in its window the label's time lies.");
  of_frames.at("pairs", spec.pairs, objects(list_pairs),
               "which pairs of frames become samples. Of other datasets these are windows of "
               "events.");
  list_flow(fields, spec, annotations || window_s || window_events || label_at);
}

// Below 16 pixels a side the network's four halvings leave less than one pixel of the image at
// its bottom; above 8192 no camera of these datasets goes, so that a larger number is a slip.
Integers sides() { return integers(16, 8192); }

struct Preset {
  std::string_view name;
  GreyOrder grey = GreyOrder::kBeforeResize;
  int blur = 0;
  bool operator==(const Preset&) const = default;
};

// As the published scripts for KITTI, for MPII and Human3.6M, and for the demo.
constexpr Preset kKitti{"kitti", GreyOrder::kBeforeResize, 3};
constexpr Preset kMpii{"mpii", GreyOrder::kBeforeResize, 0};
constexpr Preset kDemo{"demo", GreyOrder::kAfterResize, 0};
constexpr std::array kPresetWords{Word<Preset>{kKitti.name, kKitti},
                                  Word<Preset>{kMpii.name, kMpii}, Word<Preset>{kDemo.name, kDemo}};

/// The preset of the sources' datasets. A job has one preprocessing: where they differ, that is a
/// fault of `preset`, which had to say which.
Preset default_preset(const std::vector<SourceSpec>& sources, Fields& image) {
  if (sources.empty()) return kKitti;  // a fault already
  const DatasetRow& first = dataset_row(sources.front().dataset);
  for (const SourceSpec& source : sources) {
    const DatasetRow& other = dataset_row(source.dataset);
    if (other.preset == first.preset) continue;
    image.fault("preset", fmt::format("a preset, since {} has \"{}\" and {} has \"{}\"", first.word,
                                      first.preset, other.word, other.preset));
    break;
  }
  return value_of_word(kPresetWords, first.preset).value_or(Preset());
}

/// "kitti for kitti_object, kitti_raw; mpii for ..."
std::string default_presets() {
  std::vector<std::string> presets;
  for (const Word<Preset>& preset : kPresetWords) {
    const auto has = [&](const DatasetRow& row) { return row.preset == preset.word; };
    presets.push_back(
        fmt::format("{} for {}", preset.word, fmt::join(words_where(kDatasets, has), ", ")));
  }
  return fmt::format("{}", fmt::join(presets, "; "));
}

void list_image(Fields& fields, ImageSpec& spec, const std::vector<SourceSpec>& sources) {
  std::optional<int> height, width;
  fields.find("height", height, sides(), "Height of the volumes in pixels; with width.");
  fields.find("width", width, sides(),
              "Width of the volumes in pixels; with height. Without both, every image keeps its "
              "own size (a pair no image of which can be read yet gets a shard of its own). At "
              "least 16, since the network halves the image four times.");
  fields.needs("height", "width");
  fields.needs("width", "height");
  if (height && width) spec.size = {*height, *width};
  fields.find("fit", spec.fit, words(kFitWords),
              "stretch: fill the volume, whatever becomes of the shape. letterbox: keep the shape, "
              "with borders. crop: keep the shape, cut what is over.");

  std::optional<Preset> preset;
  std::optional<GreyOrder> grey;
  std::optional<int> blur;
  const auto of_preset = fields.find(
      "preset", preset, words(kPresetWords),
      "The preprocessing of the published scripts. kitti: grey, resize, 3x3 blur. mpii (Human3.6M "
      "too): grey, resize. demo: resize, grey. Default: " +
          default_presets() + "; sources of which these differ need a preset, or grey and blur.");
  const auto of_grey = fields.find("grey", grey, words(kGreyWords),
                                   "Whether the image is made grey before or after it is resized; "
                                   "with blur, in place of a preset.");
  const auto of_blur = fields.find("blur", blur, integers(0, 31),
                                   "Side of the Gaussian kernel in pixels, odd from 3 on; 0 = no "
                                   "blur.");
  if (of_blur && (*blur == 1 || (*blur > 0 && *blur % 2 == 0))) {
    of_blur->fault("0 (no blur) or an odd integer 3..31");
  }
  fields.rule(R"({"properties": {"blur": {"anyOf": [{"const": 0},
                                                    {"minimum": 3, "not": {"multipleOf": 2}}]}}})");
  std::optional<std::array<double, 2>> range;
  const auto of_range = fields.find(
      "range", range, pairs_of(0, 65535, Ends::kAbove),
      "Of images of 16 bits: the values that become 0 and 255, others are cut. Default: the upper "
      "8 bits are taken. Images of 8 bits stay as they are.");
  if (range) spec.range = {(*range)[0], (*range)[1]};
  if (!sources.empty() && std::ranges::all_of(sources, has_events, &SourceSpec::dataset)) {
    for (const auto& key : {of_preset, of_grey, of_blur, of_range}) {
      if (key) key->fault("no such key for events, which have no grey values");
    }
    return;
  }
  fields.sets("preset", {"grey", "blur"});
  if (!of_preset) {
    fields.needs("grey", "blur");
    fields.needs("blur", "grey");
  }
  if (!fields.is_reading()) return;
  if (!preset && !grey && !blur) preset = default_preset(sources, fields);
  if (!preset) preset = Preset{"", grey.value_or(spec.grey), blur.value_or(spec.blur)};
  spec.preset = preset->name;
  spec.grey = preset->grey;
  spec.blur = preset->blur;
}

auto images_of(const std::vector<SourceSpec>& sources) {
  return objects<ImageSpec>([&sources](Fields& fields, ImageSpec& spec) {  //
    list_image(fields, spec, sources);
  });
}

void list_volume(Fields& fields, VolumeSpec& spec) {
  fields.find("bins", spec.bins, integers(1, 64),
              "Time bins per polarity; the published network has 9.");
  fields.find("normalize", spec.normalize, words(kNormalizationWords),
              "none: volumes as generated. eta98: each clipped at the 98th percentile of its "
              "non-zero values and divided by it.");
}

void list_output(Fields& fields, OutputSpec& spec) {
  fields.at("directory", spec.directory, paths(), "Folder of the shards; made if it is absent.");
  fields.find(
      "samples_per_shard", spec.samples_per_shard, integers(1, 65536),
      "Samples in a shard; the last of a source holds the rest. Default: what one core makes "
      "in about 20 s, 8 to 64.");
  fields.find("dtype", spec.dtype, words(kStoredTypeWords),
              "Type of the stored values. uint8: 255 steps up to the sample's largest value.");
  fields.find("deflate_level", spec.deflate_level, integers(0, 9),
              "0 stores without compression, 9 compresses hardest.");
}

void list_errors(Fields& fields, ErrorSpec& spec) {
  fields.find("policy", spec.policy, words(kPolicyWords),
              "fail: the first ends the run, and so does the first box of your own labels that is "
              "left out. quarantine: such a sample keeps its slot, marked invalid, and the run "
              "goes on.");
  fields.find("max_count", spec.max_count, integers(0, 1'000'000'000),
              "More quarantined samples than this end the run.");
  fields.find(
      "max_fraction", spec.max_fraction, numbers(0, 1),
      "A larger share of quarantined samples than this ends the run. Of fewer than 100 samples "
      "one may be quarantined, unless this or max_count is 0.");
}

/// Events are the only volumes that a dataset of events can give, and no other dataset has them.
/// ESIM draws a motion of its own for an image of a sequence: the flow of the two images is not
/// that of its events.
void check_kind(const JobManifest& manifest, const std::vector<StrictValue>& sources) {
  const bool wants_events = !needs_frames(manifest.generator.kind);
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const SourceSpec& source = manifest.sources[i];
    if (manifest.generator.kind == GeneratorKind::kEsim && source.flow && is_flow_pair(source)) {
      sources[i].object().at("flow").fault(
          "no such key of sequences for generator.kind \"esim\", which draws a motion of its own");
    }
    if (has_events(source.dataset) == wants_events) continue;
    sources[i].object().at("dataset").fault(
        wants_events ? fmt::format("a dataset of events ({}), since generator.kind is \"events\"",
                                   fmt::join(words_where(kDatasets, &DatasetRow::has_events), ", "))
                     : "a dataset of frames, since generator.kind is not \"events\"");
  }
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

/// What a schema can say of the rules on sources, image and generator.
void add_rules(Fields& fields) {
  if (!fields.is_describing()) return;
  const auto sources = [](const auto& holds) -> Schema {
    const Schema is_one = {{"enum", words_where(kDatasets, holds)}};
    return {{"items", {{"properties", {{"dataset", is_one}}}}}};
  };
  Schema one_preset = Schema::array();
  for (const std::string_view preset : {kKitti.name, kMpii.name, kDemo.name, std::string_view()}) {
    const auto has = [preset](const DatasetRow& row) { return row.preset == preset; };
    one_preset.push_back({{"properties", {{"sources", sources(has)}}}});
  }
  Schema presets = Schema::parse(R"({"if": {"properties": {"image": {"properties":
      {"preset": false, "grey": false, "blur": false}}}}})");
  presets["then"]["anyOf"] = one_preset;
  fields.rule(presets);
  Schema events = Schema::parse(R"({
      "if": {"required": ["generator"], "properties": {"generator": {
          "required": ["kind"], "properties": {"kind": {"const": "events"}}}}},
      "then": {"properties": {"image": {"properties":
          {"preset": false, "grey": false, "blur": false}}}}})");
  const auto has_none = [](const DatasetRow& row) { return !row.has_events; };
  events["then"]["properties"]["sources"] = sources(&DatasetRow::has_events);
  events["else"]["properties"]["sources"] = sources(has_none);
  fields.rule(events);
  fields.rule(R"({"if": {"required": ["generator"], "properties": {"generator": {
                      "required": ["kind"], "properties": {"kind": {"const": "esim"}}}}},
                  "then": {"properties": {"sources": {"items": {
                      "if": {"required": ["flow"], "properties": {"flow": {"const": true}}},
                      "then": {"required": ["pairs"], "properties": {"pairs": {
                          "required": ["from"], "properties": {"from": {"const": "stills"}}}}}}}}}})");
}

constexpr char kImageField[] =
    "How a frame becomes the network's input. Either a preset or both grey and blur, or none of "
    "them: then the datasets' own preset holds.";
constexpr char kGeneratorField[] =
    "What makes event volumes: of frame pairs the network, or a model of the sensor to compare it "
    "with; of recordings the camera.";
constexpr char kVolumeField[] = "The event volumes.";

void list_pair_manifest(Fields& fields, JobManifest& manifest) {
  const std::vector<SourceSpec> sources{SourceSpec()};  // frames
  manifest.image.preset = kDemo.name;
  manifest.image.grey = kDemo.grey;
  fields.find("seed", manifest.seed, seeds(), kSeedField);
  fields.find("image", manifest.image, images_of(sources), kImageField);
  const auto generator =
      fields.find("generator", manifest.generator, objects(list_generator), kGeneratorField);
  if (!needs_frames(manifest.generator.kind)) {
    generator->object().at("kind").fault("a generator that makes events of frames");
  }
  if (manifest.generator.device != Device::kCpu || manifest.generator.engine == Engine::kTorch) {
    generator->fault("the engine \"onednn\" on the device \"cpu\"");
  }
  fields.find("volume", manifest.volume, objects(list_volume), kVolumeField);
}

}  // namespace

void list_job(Fields& fields, JobManifest& manifest) {
  if (!fields.has_format("eventgan-manifest", 1)) return;
  fields.at("name", manifest.name, names(),
            "Name of the data that is made, the first part of its files' names.");
  fields.find("seed", manifest.seed, seeds(), kSeedField);
  const auto sources = fields.at("sources", manifest.sources, lists(objects(list_source), 1),
                                 "The datasets to convert, in the order of their shards.");
  const auto image = fields.at("image", manifest.image, images_of(manifest.sources), kImageField);
  fields.find("generator", manifest.generator, objects(list_generator), kGeneratorField);
  if (sources && sources->is_array()) check_kind(manifest, sources->elements());
  add_rules(fields);
  fields.find("volume", manifest.volume, objects(list_volume), kVolumeField);
  fields.at("output", manifest.output, objects(list_output), "The files that are made.");
  fields.find("errors", manifest.errors, objects(list_errors),
              "What becomes of samples that cannot be made (a corrupt image, a malformed label).");
  if (image) check_chunk(manifest, *image);
}

JobManifest parse_job_manifest(std::string_view text, const std::filesystem::path& directory,
                               const std::string& name) {
  return parse_manifest(with_sensor_document(text, directory), directory, name, list_job);
}

JobManifest parse_pair_manifest(std::string_view text, const std::filesystem::path& directory,
                                const std::string& name) {
  return parse_manifest(with_sensor_document(text, directory), directory, name, list_pair_manifest);
}

JobManifest read_job_manifest(const std::filesystem::path& file) {
  return parse_job_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan

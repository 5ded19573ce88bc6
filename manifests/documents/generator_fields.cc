#include <fmt/format.h>

#include <cmath>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/sensor_document.h"
#include "manifests/values/weights.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

/// Names of weights.
Texts weights_names() {
  return {
      "the path of a .safetensors file, \"shipped\", \"shipped:sensor\", or \"shipped:WIDTH\" "
      "or \"untrained:WIDTH\" with WIDTH in 1..64",
      [](std::string_view text) { return parse_weights_name(text).has_value(); },
      R"({"title": "path, or name of weights", "type": "string",
              "anyOf": [{"pattern": "^(?!untrained:|shipped:)[^\\u0000]+$"},
                        {"const": "shipped:sensor"},
                        {"pattern": "^(untrained|shipped):([1-9]|[1-5][0-9]|6[0-4])$"}]})"};
}

/// A threshold is that of frames, unless an ε is told beside it.
void set_threshold(GeneratorSpec& spec, std::optional<double> log_epsilon = std::nullopt) {
  const auto [least, most] = spec.threshold->range;
  spec.sensor.log_epsilon = log_epsilon.value_or(kFrameLogEpsilon);
  spec.sensor =
      spec.threshold->applied(spec.sensor, {std::sqrt(least * most), spec.threshold->ratio});
}

/// A generator's `sensor` that is no document: what is asked of any kind, and of a simulator its
/// settings.
void list_pair_sensor(Fields& fields, GeneratorSpec& spec) {
  list_threshold(fields, spec.threshold,
                 "Contrast threshold, the geometric mean of both polarities', or [least, most], "
                 "from which it is drawn log-uniformly for each pair; in /pairs/threshold. In "
                 "place of positive_threshold and negative_threshold; threshold_spread is 15 % of "
                 "the lower polarity's and log_epsilon 0.02 unless given.");
  fields.sets("threshold", {"positive_threshold", "negative_threshold"});
  fields.find("noise", spec.noise, objects(list_noise), kNoiseField);
  list_sensor(fields.only_for(words_where(kGenerators, &GeneratorRow::has_sensor_settings)),
              spec.sensor);
  if (!spec.threshold) return;
  const SensorSpec& told = spec.sensor;
  if (fields.peek("threshold_spread")) spec.threshold->spread = told.threshold_spread;
  set_threshold(spec, fields.peek("log_epsilon") ? std::optional(told.log_epsilon) : std::nullopt);
}

/// A generator's `sensor`: a document, whose name or path it was (with_sensor_document), or
/// settings.
struct PairSensors {
  std::string_view kind;  ///< the generator's; none: faulty

  void read(const StrictValue& value, GeneratorSpec& spec) const {
    if (value.is_text()) {
      value.fault(fmt::format("{} or the path of a sensor's document (*.json)",
                              fmt::join(shipped_sensors(), ", ")));
      return;
    }
    Fields fields(value);
    if (fields.peek("format")) {
      CameraSensor camera;
      objects(list_camera_sensor).read(value, camera);
      spec.camera = camera.name;
      spec.noise = camera.noise;
      spec.threshold = camera.threshold;
      if (!kind.empty() && has_weights(spec.kind)) take_network_threshold(value, camera, spec);
      if (spec.threshold) set_threshold(spec);
      return;
    }
    fields.within("kind", kind);
    list_pair_sensor(fields, spec);
    fields.finish();
  }

  /// Told a model's threshold, a network would make other events than the camera.
  static void take_network_threshold(const StrictValue& value, const CameraSensor& camera,
                                     GeneratorSpec& spec) {
    if (camera.network) {
      spec.threshold = camera.network->threshold;
      spec.threshold_weights = camera.network->weights;
    } else if (camera.threshold) {
      value.fault("a \"network\" in the sensor's document, which `eventgan fit --weights` finds",
                  "a threshold of difference and esim alone");
    }
  }

  Schema schema(const GeneratorSpec& spec) const {
    const std::string names =
        fmt::format(R"(^({}|[^\u0000]*\.json)$)", fmt::join(shipped_sensors(), "|"));
    Schema document = {{"title", "a sensor's document"}};
    document.update(objects(list_camera_sensor).schema(CameraSensor()));
    const Schema name = {{"title", "name or path of such"}, {"type", "string"}, {"pattern", names}};
    return {{"anyOf", Schema::array({document, name, objects(list_pair_sensor).schema(spec)})}};
  }
  Schema json(const GeneratorSpec&) const { return {}; }
};

/// What a schema can say of the network's sensor: a simulator's settings are not for it, and the
/// duration without noise is not.
Schema network_rule() {
  const auto has_none = [](const GeneratorRow& row) { return !row.has_sensor_settings; };
  Schema rule = Schema::parse(R"({
      "if": {"properties": {}},
      "then": {"properties": {"sensor": {"if": {"required": ["format"]}, "else": {}}},
               "if": {"required": ["duration_s"]},
               "then": {"required": ["sensor"],
                        "properties": {"sensor": {"required": ["noise"]}}}}})");
  rule["if"]["properties"]["kind"]["enum"] = words_where(kGenerators, has_none);
  const Schema settings = objects(list_sensor).json(SensorSpec());
  for (const auto& [key, value] : settings.items()) {
    rule["then"]["properties"]["sensor"]["else"]["properties"][key] = false;
  }
  return rule;
}

}  // namespace

void list_generator(Fields& fields, GeneratorSpec& spec) {
  fields.kind("kind", spec.kind, words(kGeneratorWords),
              "network: EventGAN. esim: a random affine motion of the previous frame, as the paper "
              "compares with, or a still's own motion. difference: each pixel's log intensity "
              "moves on a line from the "
              "previous frame to the next. The volumes of these two are counts of events. events: "
              "the camera's own, of recording and dhp19, which have no other: counts, each event "
              "in the volume's pixel that its place falls in.");
  Fields::Only some = fields.taken_by(kGenerators);
  some.find("weights", spec.weights, weights_names(),
            "a .safetensors file, as `eventgan train` and `eventgan import-weights` make it; "
            "shipped, the weights that come with the program, or shipped:WIDTH, those of that base "
            "width; shipped:sensor, those that know their sensor and give events; or "
            "untrained:WIDTH, a network of random numbers of that base width (1..64), for trials "
            "only.");
  some.find("engine", spec.engine, words(kEngineWords),
            "what computes it. torch: LibTorch, the reference. onednn: oneDNN, the fast one. auto: "
            "the fastest for the precision on the processor that runs it; convert says which.");
  some.find("device", spec.device, words(kDeviceWords),
            "where it is computed. cuda: the first GPU that CUDA_VISIBLE_DEVICES leaves, by the "
            "engine torch in float32 or bfloat16, with a LibTorch that has CUDA.");
  some.find("precision", spec.precision, words(kPrecisionChoiceWords),
            "the numbers of its convolutions. bfloat16 is worth its error only on processors with "
            "AVX512-BF16 or AMX; auto takes it there, else float32, and convert says which. int8 "
            "needs weights with a calibration, as `eventgan calibrate` makes them. Volumes are "
            "float32 before they are stored, whatever this is.");
  some.find("sample", spec.sample, booleans(),
            "of weights that know their sensor, whose values are numbers of events to be expected: "
            "draws events of them, repeatably for each pair. false: volumes hold those numbers. Of "
            "other weights without effect.");
  some.find("scope", spec.scope.scope, words(kScopeWords),
            "which part of a volume is generated, in tiles; the rest is zeros, and /events/tiles "
            "tells one from the other. motion: where the two frames differ. labels: there, and "
            "around labelled boxes and persons. labels_only: around these alone.");
  some.find("motion_threshold", spec.scope.motion_threshold, numbers(0, 255),
            "with scope, a pixel moves if the difference of the two frames, smoothed over 3x3 "
            "pixels, exceeds this many grey levels.");
  some.find("motion_margin_px", spec.scope.motion_margin_px, integers(0, 64),
            "with scope, rows and columns around a pixel that moves which are generated too.");
  some.find("label_margin_px", spec.scope.label_margin_px, integers(0, 1024),
            "with scope, rows and columns around a box, and around all that pose trainers cut out "
            "around a person by default, which are generated too.");
  some.find("tile_px", spec.scope.tile_px, integers(8, 128), "with scope, side of the tiles.");
  some.find("sensor", spec, PairSensors{fields.found_kind()},
            "the camera whose volumes are made: a name that ships, the path of a sensor's document "
            "(eventgan-sensor, as `eventgan fit` writes it), that document itself, or settings.");
  const auto duration = some.find(
      "duration_s", spec.duration_s, numbers(1e-4, 10),
      "time between the two frames. esim, difference: which the simulated sensor needs. With "
      "sensor.noise, of any kind: of pairs whose gap_s is unknown.");
  if (duration && !fields.found_kind().empty() && has_weights(spec.kind) && !spec.noise) {
    duration->fault(
        fmt::format("no such key for kind \"{}\" without sensor.noise", to_string(spec.kind)));
  }
  some.find("max_displacement_px", spec.max_displacement_px, numbers(0.1, 100),
            "the largest displacement of a motion is drawn uniformly from 0 to this, whatever the "
            "gap of the pair.");
  if (fields.is_describing()) fields.rule(network_rule());
}

}  // namespace eventgan

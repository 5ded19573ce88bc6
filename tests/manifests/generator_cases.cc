#include "tests/manifests/manifest_cases.h"

namespace eventgan::testing {

std::vector<ManifestCase> generator_cases() {
  const std::string kWeights = "/generator/weights";
  const auto wrong_weights = [](const std::string& name, const std::string& value) {
    return ManifestCase{
        name, {{"/generator/weights", value}}, {"$.generator.weights: " + kWeightsRule + value}};
  };
  return {
      {"untrained weights", {{kWeights, R"("untrained:64")"}}, {}},
      wrong_weights("untrained weights of no width", R"("untrained:")"),
      wrong_weights("untrained weights too wide", R"("untrained:65")"),
      wrong_weights("untrained weights with a zero in front", R"("untrained:08")"),
      {"shipped weights", {{kWeights, R"("shipped")"}}, {}},
      {"shipped weights of a width", {{kWeights, R"("shipped:16")"}}, {}},
      wrong_weights("shipped weights of no width", R"("shipped:x")"),
      wrong_weights("empty weights", R"("")"),
      {"no weights are the shipped ones", {{kWeights, ""}}, {}},
      {"an engine", {{"/generator/engine", R"("onednn")"}}, {}},
      {"the engine of the programs choice", {{"/generator/engine", R"("auto")"}}, {}},
      {"another engine",
       {{"/generator/engine", R"("tensorrt")"}},
       {R"($.generator.engine: expected "auto", "torch" or "onednn", got "tensorrt")"}},
      {"half a precision", {{"/generator/precision", R"("bfloat16")"}}, {}},
      {"a quarter of a precision", {{"/generator/precision", R"("int8")"}}, {}},
      {"another precision",
       {{"/generator/precision", R"("float16")"}},
       {R"($.generator.precision: expected "float32", "bfloat16" or "int8", got "float16")"}},
      {"the network by its kind", {{"/generator/kind", R"("network")"}}, {}},
      {"a kind of no kind",
       {{"/generator", R"({"kind": "v2e", "weights": "w", "sensor": {}})"}},
       {R"($.generator.kind: expected "network", "esim" or "difference", got "v2e")"}},
      {"a simulator", {{"/generator", R"({"kind": "esim"})"}}, {}},
      {"a simulator with all its keys",
       {{"/generator", R"({"kind": "esim", "duration_s": 10, "max_displacement_px": 0.1, "sensor": {
           "positive_threshold": 5, "negative_threshold": 0.01, "threshold_spread": 0,
           "refractory_s": 1, "leak_rate_hz": 0, "shot_noise_rate_hz": 1e6,
           "hot_pixel_fraction": 1, "hot_pixel_rate_hz": 7, "log_epsilon": 1e-6}})"}},
       {}},
      {"a simulator with the networks keys",
       {{"/generator", R"({"kind": "difference", "weights": "w", "engine": "auto",
                           "precision": "float32", "max_displacement_px": 3})"}},
       {R"($.generator.weights: expected no such key for kind "difference" (of network only), got "w")",
        R"($.generator.engine: expected no such key for kind "difference" (of network only), got "auto")",
        R"($.generator.precision: expected no such key for kind "difference" (of network only), got "float32")",
        R"($.generator.max_displacement_px: expected no such key for kind "difference" (of esim only), got 3)"}},
      {"the network with a simulators keys",
       {{"/generator/sensor", "{}"}, {"/generator/duration_s", "1"}},
       {R"($.generator.sensor: expected no such key for kind "network" (of esim, difference only), got an object)",
        R"($.generator.duration_s: expected no such key for kind "network" (of esim, difference only), got 1)"}},
      {"a simulator out of range",
       {{"/generator", R"({"kind": "esim", "duration_s": 0, "max_displacement_px": 101,
                           "sensor": {"positive_treshold": 1, "negative_threshold": -0.2}})"}},
       {"$.generator.sensor.negative_threshold: expected a number 0.01..5, got -0.2",
        R"($.generator.sensor.positive_treshold: expected the key "positive_threshold" or none, got an unknown key)",
        "$.generator.duration_s: expected a number 1e-04..10, got 0",
        "$.generator.max_displacement_px: expected a number 0.1..100, got 101"}},
  };
}

}  // namespace eventgan::testing

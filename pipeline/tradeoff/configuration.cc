#include "pipeline/tradeoff/configuration.h"

#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "pipeline/generators/choose_engine.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {

Configuration own_configuration(const JobManifest& manifest) {
  const GeneratorSpec& generator = manifest.generator;
  if (!has_weights(generator.kind)) {
    return {{.method = generator.kind, .weights = ""}, manifest.output.dtype};
  }
  return {{.weights = shipped_weights_name(generator.weights),
           .precision = precision_of(generator),
           .scope = generator.scope.scope},
          manifest.output.dtype};
}

std::vector<Computation> computations(const TradeoffAxes& axes) {
  std::vector<Computation> all;
  for (const GeneratorKind method : axes.methods) {
    const bool is_network = has_weights(method);
    for (const std::string& weights : is_network ? axes.weights : std::vector<std::string>{""}) {
      for (const Precision precision :
           is_network ? axes.precisions : std::vector{Precision::kFloat32}) {
        for (const Scope scope : is_network ? axes.scopes : std::vector{Scope::kWhole}) {
          for (const double size : axes.sizes) {
            all.push_back({method, weights, precision, size, scope});
          }
        }
      }
    }
  }
  return all;
}

std::string name_of(const Computation& computation) {
  std::string method =
      has_weights(computation.method)
          ? fmt::format("{} {}", computation.weights, to_string(computation.precision))
          : std::string(to_string(computation.method));
  if (computation.scope != Scope::kWhole) method.append(" ").append(to_string(computation.scope));
  return fmt::format("{} x{:g}", method, computation.size);
}

std::string name_of(const Configuration& configuration) {
  return fmt::format("{} {}", name_of(configuration.computation), to_string(configuration.dtype));
}

namespace {

using Json = nlohmann::ordered_json;

Json generator_keys(const Json& manifest, const JobManifest& job, const Computation& computation) {
  Json keys = manifest.value("generator", Json::object());
  const bool is_network = has_weights(computation.method);
  if (is_network != has_weights(job.generator.kind)) keys = Json::object();
  if (is_network) {
    keys["weights"] = computation.weights;
    keys["precision"] = to_string(computation.precision);
    keys["scope"] = to_string(computation.scope);
    return keys;
  }
  keys["kind"] = to_string(computation.method);
  const GeneratorRow& row = generator_row(computation.method);
  for (const GeneratorRow& other : kGenerators) {  // of which it was made
    for (const std::string_view key : other.keys) {
      if (!takes(row, key)) keys.erase(std::string(key));
    }
  }
  return keys;
}

int scaled(int side, double size) { return static_cast<int>(std::lround(side * size)); }

}  // namespace

TrialJob trial_job(const JobManifest& manifest, const Configuration& configuration,
                   std::optional<ImageSize> whole) {
  const Computation& computation = configuration.computation;
  Json json = Json::parse(manifest.text, nullptr, true, /*ignore_comments=*/true);
  std::vector<std::string> changed{"generator", "output"};
  if (computation.size != 1) {
    if (manifest.image.size) whole = manifest.image.size;
    if (!whole) {
      throw UsageError(
          "size: expected images of one size, or $.image.width and height in the manifest, got "
          "images of several sizes");
    }
    json["image"]["width"] = scaled(whole->width, computation.size);
    json["image"]["height"] = scaled(whole->height, computation.size);
    changed.insert(changed.begin(), "image");
  }
  json["generator"] = generator_keys(json, manifest, computation);
  json["output"]["dtype"] = to_string(configuration.dtype);
  TrialJob trial{parse_job_manifest(dump_json(json), manifest.directory, name_of(configuration)),
                 {}};
  for (const std::string& key : changed) {
    trial.lines.push_back(fmt::format("\"{}\": {}", key, dump_json(json[key])));
  }
  return trial;
}

}  // namespace eventgan

// One inference engine as a server for engines.py, which alternates engines, so that all meet
// the same noise: it reads requests from stdin, a line each, and answers with a line of JSON.
//   input HEIGHT WIDTH FILE   the frames [2, y, x], float32 in [-1, 1], raw; warms up
//   run     one forward pass: {"wall_ms": ..., "cpu_ms": ...}
//   error   against LibTorch in float32: {"relative_l2": ..., "relative_largest": ...}
//   saturation   of 8-bit activations: {"share": ...}
//   level TRIES, noise TRIES   what small changes of the frames do to the volume:
//           {"l2": ..., "largest": ..., "relative_l2": ...}

#include <CLI/CLI.hpp>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/values/weights.h"
#include "pipeline/runtime/memory.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/weights.h"
#include "stages/generator/weights_file.h"
#include "tests/benchmarks/engines/engine_contender.h"

namespace eventgan {
namespace {

constexpr int kBins = 9;
constexpr std::uint64_t kSeed = 7;

Weights weights_of(const std::string& text) {
  const auto name = parse_weights_name(text);
  if (!name) {
    throw std::invalid_argument("expected a file, shipped:WIDTH or untrained:WIDTH, got " + text);
  }
  switch (name->origin) {
    case WeightsOrigin::kUntrained:
      return untrained_weights(name->width.value(), kBins, kSeed);
    case WeightsOrigin::kShipped:
      return read_shipped_weights(name->width ? *name->width : default_shipped_width());
    case WeightsOrigin::kFile:
      break;
  }
  return read_weights(name->path);
}

std::vector<float> read_frames(const std::string& path, ImageSize size) {
  std::vector<float> frames(2 * size.pixel_count());
  std::ifstream file(path, std::ios::binary);
  const auto bytes = static_cast<std::streamsize>(frames.size() * sizeof(float));
  if (!file.read(reinterpret_cast<char*>(frames.data()), bytes)) {
    throw std::runtime_error("expected " + std::to_string(bytes) + " bytes, got fewer, in " + path);
  }
  return frames;
}

nlohmann::json answer(const std::string& request, EngineContender& contender) {
  std::istringstream words(request);
  std::string word, path;
  words >> word;
  if (ImageSize size; word == "input" && words >> size.height >> size.width >> path) {
    contender.set_input(size, read_frames(path, size));
    return {{"size", {size.height, size.width}}};
  }
  if (word == "run") {
    const PassTime time = contender.run();
    return {{"wall_ms", time.wall_ms}, {"cpu_ms", time.cpu_ms}};
  }
  if (word == "error") {
    const VolumeError error = contender.error();
    return {{"relative_l2", error.relative_l2}, {"relative_largest", error.relative_largest}};
  }
  if (word == "saturation") return {{"share", contender.saturated_share()}};
  if (int tries = 0; (word == "level" || word == "noise") && words >> tries) {
    const Amplification most = contender.amplification(
        word == "level" ? SmallChange::kOneLevelOfOnePixel : SmallChange::kRoundingNoise, tries);
    return {{"l2", most.l2}, {"largest", most.largest}, {"relative_l2", most.relative_l2}};
  }
  throw std::invalid_argument(
      "expected input HEIGHT WIDTH FILE, run, error, saturation, level TRIES or noise TRIES, got "
      "\"" +
      request + "\"");
}

void serve(const ContenderSetup& setup, const std::string& weights) {
  EngineContender contender(setup, weights_of(weights));
  std::cout << nlohmann::json{{"description", contender.description()},
                              {"native", contender.native()}}
            << std::endl;
  for (std::string request; std::getline(std::cin, request);) {
    std::cout << answer(request, contender) << std::endl;
  }
}

const std::map<std::string, Engine> kEngines = {{"torch", Engine::kTorch},
                                                {"onednn", Engine::kOnednn}};
const std::map<std::string, Precision> kPrecisions = {{"float32", Precision::kFloat32},
                                                      {"bfloat16", Precision::kBfloat16},
                                                      {"int8", Precision::kInt8}};

int run_program(int argc, char** argv) {
  CLI::App app("One inference engine as a server for tests/benchmarks/engines.py");
  std::string engine = "torch", precision = "float32", weights = "untrained:32";
  ContenderSetup setup;
  app.add_option("--engine", engine)->check(CLI::IsMember(&kEngines));
  app.add_option("--precision", precision)->check(CLI::IsMember(&kPrecisions));
  app.add_option("--weights", weights, "FILE.safetensors, shipped:WIDTH or untrained:WIDTH");
  app.add_option("--instances", setup.instances)->check(CLI::Range(1, 1024));
  app.add_option("--intra-op", setup.intra_op)->check(CLI::Range(1, 1024));
  app.add_option("--shrink", setup.shrink, "Divides the activations by two to this power");
  CLI11_PARSE(app, argc, argv);
  setup.engine = kEngines.at(engine);
  setup.precision = kPrecisions.at(precision);
  serve(setup, weights);
  return 0;
}

}  // namespace
}  // namespace eventgan

int main(int argc, char** argv) {
  eventgan::keep_big_buffers();  // as the program does
  try {
    return eventgan::run_program(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << std::endl;
    return 1;
  }
}

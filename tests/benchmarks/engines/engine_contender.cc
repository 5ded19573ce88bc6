#include "tests/benchmarks/engines/engine_contender.h"

#include <ATen/Parallel.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <stdexcept>
#include <utility>

#include "manifests/values/counter_random.h"
#include "pipeline/generators/choose_engine.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

constexpr int kWarmUpPasses = 2;
constexpr ImageSize kSmallSize{16, 16};

constexpr std::uint64_t kChangesSeed = 11;
constexpr float kOneLevel = 2.0f / 255;
constexpr float kNoise = 1e-6f;

double distance(const std::vector<float>& a, const std::vector<float>& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    squares += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
  }
  return std::sqrt(squares);
}

double process_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * double(now.tv_sec) + 1e-6 * double(now.tv_nsec);
}

std::vector<float> volume_of(const Weights& weights, ImageSize size) {
  return std::vector<float>(2 * static_cast<std::size_t>(weights.bins) * size.pixel_count());
}

/// Throws UsageError where a job could not have this engine either, before a pass fails in it.
std::unique_ptr<Generator> make_generator(const ContenderSetup& setup, const Weights& weights) {
  EngineRequest request;
  request.engine = setup.engine;
  request.precision = setup.precision;
  request.calibrated = weights.calibration != nullptr;
  choose_engine(request, engine_support(setup.precision));
  return setup.engine == Engine::kTorch ? make_torch_generator(weights, setup.precision)
                                        : make_onednn_generator(weights, setup.precision);
}

/// LibTorch computes bfloat16 with the oneDNN it carries.
bool has_instructions(const ContenderSetup& setup) {
  return setup.precision == Precision::kFloat32 || onednn_support(setup.precision).native;
}

/// Every activation times 2^-exponent, half of it by the first layer's weights, the other by the
/// frames, so that these stay normal numbers.
Weights shrunk(Weights weights, int exponent) {
  for (Convolution& layer : weights.convolutions) {
    if (layer.name == "pred") continue;
    for (float& number : layer.bias) number = std::ldexp(number, -exponent);
    if (layer.name != "head") continue;
    for (float& number : layer.weight) number = std::ldexp(number, -exponent / 2);
  }
  return weights;
}

}  // namespace

EngineContender::EngineContender(const ContenderSetup& setup, Weights weights)
    : setup_(setup),
      weights_(shrunk(std::move(weights), setup.shrink)),
      native_(has_instructions(setup_)),
      generator_(make_generator(setup_, weights_)),
      instances_(
          setup.instances, [this] { allow_intra_op_threads(); },
          [this](int instance) { generate(instance); }) {}

void EngineContender::set_input(ImageSize size, std::vector<float> frames) {
  size_ = size;
  frames_ = std::move(frames);
  for (float& value : frames_) value = std::ldexp(value, setup_.shrink / 2 - setup_.shrink);
  volumes_.assign(static_cast<std::size_t>(setup_.instances), volume_of(weights_, size));
  for (int pass = 0; pass < kWarmUpPasses; ++pass) instances_.run();
}

PassTime EngineContender::run() {
  if (volumes_.empty()) throw std::logic_error("expected an input before run");
  const double cpu_ms = process_ms();
  const auto start = std::chrono::steady_clock::now();
  instances_.run();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  return {wall.count(), process_ms() - cpu_ms};
}

VolumeError EngineContender::error() {
  if (volumes_.empty()) throw std::logic_error("expected an input before error");
  instances_.run();
  std::vector<float> expected = volume_of(weights_, size_);
  make_torch_generator(weights_)->generate({frames_, size_}, expected);
  return volume_error(volumes_.front(), expected);
}

double EngineContender::saturated_share() const {
  std::vector<float> volume = volume_of(weights_, size_);
  return generator_->generate({frames_, size_}, volume).saturated_share;
}

Amplification EngineContender::amplification(SmallChange change, int tries) const {
  std::vector<float> before = volume_of(weights_, size_), after = before;
  generator_->generate({frames_, size_}, before);
  const CounterRandom random(kChangesSeed);
  std::uint64_t drawn = 0;
  Amplification most;
  for (int i = 0; i < tries; ++i) {
    std::vector<float> changed = frames_;
    if (change == SmallChange::kOneLevelOfOnePixel) {
      float& value = changed[static_cast<std::size_t>(random.uniform(drawn++) *
                                                      static_cast<double>(changed.size()))];
      value += value > 0 ? -kOneLevel : kOneLevel;
    } else {
      for (float& value : changed) {
        value += kNoise * static_cast<float>(2 * random.uniform(drawn++) - 1);
      }
    }
    generator_->generate({changed, size_}, after);
    const double frames_moved = distance(changed, frames_), moved = distance(after, before);
    const VolumeError error = volume_error(after, before);
    most.l2 = std::max(most.l2, moved / frames_moved);
    most.largest = std::max(most.largest, error.relative_largest);
    most.relative_l2 = std::max(most.relative_l2, error.relative_l2);
  }
  return most;
}

/// LibTorch's engine takes one thread on the first call of each thread; after it the setting is
/// ours. (oneDNN's computes with one, whatever the setting.)
void EngineContender::allow_intra_op_threads() {
  if (setup_.intra_op == 1) return;
  std::vector<float> volume = volume_of(weights_, kSmallSize);
  const std::vector<float> frames(2 * kSmallSize.pixel_count());
  generator_->generate({frames, kSmallSize}, volume);
  at::set_num_threads(setup_.intra_op);
  omp_set_num_threads(setup_.intra_op);
}

void EngineContender::generate(int instance) {
  generator_->generate({frames_, size_}, volumes_[static_cast<std::size_t>(instance)]);
}

}  // namespace eventgan

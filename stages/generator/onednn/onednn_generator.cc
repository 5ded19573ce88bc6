#include "stages/generator/onednn/onednn_generator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ctime>
#include <dnnl.hpp>
#include <limits>
#include <map>
#include <mutex>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "stages/generator/flush_subnormals.h"
#include "stages/generator/generator.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/detail/network_plan.h"
#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/onednn/detail/tiled_layers.h"
#include "stages/generator/onednn/narrow_layers.h"
#include "stages/generator/onednn/winograd.h"

namespace eventgan {

OnednnSupport onednn_support(Precision precision) {
  using Isa = dnnl::cpu_isa;
  OnednnSupport support{.built = true, .instruction_set = instruction_set_name()};
  switch (precision) {
    case Precision::kFloat32:
      support.able = support.native = processor_has(Isa::sse41);
      break;
    case Precision::kBfloat16:
      support.able = processor_has(Isa::avx512_core);
      support.native = processor_has(Isa::avx512_core_bf16);
      break;
    case Precision::kInt8:
      support.able = processor_has(Isa::avx2);
      support.native = processor_has(Isa::avx2_vnni) || processor_has(Isa::avx512_core_vnni);
      break;
  }
  return support;
}

namespace {

std::string version_text() {
  const dnnl_version_t* version = dnnl_version();
  return std::to_string(version->major) + "." + std::to_string(version->minor) + "." +
         std::to_string(version->patch);
}

std::string own_layers_text(int base_channels, Precision precision) {
  if (winograd_fits(base_channels, precision)) {  // they come first
    return ", Winograd layers " + std::to_string(kWinogradVersion);
  }
  if (NarrowLayers::fit(base_channels, precision)) {
    return ", narrow layers " + std::to_string(NarrowLayers::kVersion);
  }
  return "";
}

std::size_t stored_bytes(Precision precision) {
  switch (precision) {
    case Precision::kFloat32:
      return 4;
    case Precision::kBfloat16:
      return 2;
    case Precision::kInt8:
      return 1;
  }
  throw std::logic_error("unknown precision");
}

/// What is computed of an image whose tiles are wanted.
struct PartialWork {
  TiledWork tiled;  ///< or:
  WinogradWork winograd;
  double share = 1;  ///< of the whole image's work; 0: nothing, 1: all, with neither of the two
};

PartialWork partial_work(const TileMask& wanted, bool by_winograd) {
  // Above it, computing all is not slower; what tiles depend on is more than they are.
  constexpr double kLargestShare = 0.9;
  constexpr double kManyTiles = 0.6;
  const auto tiles = static_cast<double>(std::ranges::count(wanted.wanted, 1));
  PartialWork work;
  if (tiles == 0) return {.tiled = {}, .winograd = {}, .share = 0};
  if (tiles >= kManyTiles * static_cast<double>(wanted.wanted.size())) return work;
  if (by_winograd) {
    work.winograd = winograd_work(wanted);
  } else {
    work.tiled = tiled_work(wanted);
  }
  const double share = by_winograd ? work.winograd.share : work.tiled.share;
  if (share > kLargestShare) return {};
  work.share = share;
  return work;
}

class OnednnGenerator final : public Generator {
 public:
  OnednnGenerator(const Weights& weights, Precision precision)
      : bins_(weights.bins),
        training_gaps_(weights.training_gaps),
        thresholds_(weights.thresholds),
        precision_(precision),
        description_("onednn " + std::string(to_string(precision)) + ", 1 thread, oneDNN " +
                     version_text() + ", " + onednn_support(precision).instruction_set +
                     own_layers_text(weights.base_channels, precision) + ", " +
                     describe_training_gaps(weights.training_gaps)),
        layers_(weights, precision, dnnl::engine(dnnl::engine::kind::cpu, 0)),
        plans_(layers_) {}

  int bins() const override { return bins_; }
  std::optional<GapRange> training_gaps() const override { return training_gaps_; }
  std::optional<ThresholdRange> thresholds() const override { return thresholds_; }
  std::string description() const override { return description_; }
  std::size_t working_bytes(ImageSize size) const override {
    return activation_bytes(size, layers_.base_channels(), stored_bytes(precision_));
  }

  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    check_generator_spans(pair, volume, bins_);
    // Whole numbers cannot hold what is not a number: it would come out as a plausible volume.
    if (precision_ == Precision::kInt8 && !all_finite(pair.frames)) {
      std::ranges::fill(volume, std::numeric_limits<float>::quiet_NaN());
      return {};
    }
    std::vector<float> kept;
    const std::span<const float> planes = network_planes(pair, thresholds_, kept);
    return compute(pair.size, [&] {
      const auto plan = plans_.plan(pair.size);
      const BlockPool::Lease block = blocks_.take(plan->block_bytes());
      return plan->run(planes.data(), volume.data(), block.data());
    });
  }

  GenerationNotes generate_tiles(const GeneratorInput& pair, const TileMask& wanted,
                                 std::span<float> volume) const override {
    check_generator_spans({pair.frames, wanted.size}, volume, bins_);
    const PartialWork work = partial_work(wanted, layers_.winograd().has_value());
    if (work.share == 0 || work.share == 1 ||
        (precision_ == Precision::kInt8 && !all_finite(pair.frames))) {
      return Generator::generate_tiles(pair, wanted, volume);
    }
    std::vector<float> kept;
    const std::span<const float> planes = network_planes(pair, thresholds_, kept);
    std::memset(volume.data(), 0, volume.size_bytes());
    return compute(wanted.size, [&] {
      const auto plan = plans_.plan(wanted.size);
      if (plan->winograd()) {
        const BlockPool::Lease block = blocks_.take(plan->block_bytes());
        return plan->winograd()->run_tiles(work.winograd, wanted, planes.data(), volume.data(),
                                           block.data());
      }
      const TiledLayers& layers = tiled_layers();
      const std::size_t plan_bytes = BufferLayout::aligned(plan->block_bytes());
      const BlockPool::Lease block = blocks_.take(plan_bytes + layers.layout.total_bytes());
      return plan->run_tiles(layers, work.tiled, wanted, planes.data(), volume.data(), block.data(),
                             block.data() + plan_bytes);
    });
  }

 private:
  template <class Work>
  GenerationNotes compute(ImageSize size, Work&& work) const {
    const OneOpenMpThread one_thread;
    const FlushSubnormals flush;
    try {
      return work();
    } catch (const dnnl::error&) {
      std::throw_with_nested(std::runtime_error("the generator failed in oneDNN"));
    } catch (const std::bad_alloc&) {
      std::throw_with_nested(
          std::runtime_error("expected memory for an image of " + to_string(size) + ", about " +
                             std::to_string(working_bytes(size)) + " bytes, got none"));
    }
  }

  /// Built when they are first needed.
  const TiledLayers& tiled_layers() const {
    const std::lock_guard lock(tiled_layers_mutex_);
    if (!tiled_layers_) tiled_layers_.emplace(layers_);
    return *tiled_layers_;
  }

  int bins_;
  std::optional<GapRange> training_gaps_;
  std::optional<ThresholdRange> thresholds_;
  Precision precision_;
  std::string description_;
  mutable NetworkLayers layers_;
  mutable std::mutex tiled_layers_mutex_;
  mutable std::optional<TiledLayers> tiled_layers_;
  mutable PlanCache plans_;
  mutable BlockPool blocks_;
};

}  // namespace

void require_onednn(const Weights& weights, Precision precision) {
  check_weights(weights, "the weights");
  const OnednnSupport support = onednn_support(precision);
  if (!support.able) {
    throw std::runtime_error("expected a processor on which oneDNN computes " +
                             std::string(to_string(precision)) + ", got " +
                             support.instruction_set);
  }
}

namespace {

double thread_processor_s() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double measured_int8_speedup(const Weights& weights) {
  constexpr ImageSize kSize{192, 320};
  constexpr int kRounds = 5;  // the first builds the plans
  const std::array generators{make_onednn_generator(weights, Precision::kInt8),
                              make_onednn_generator(weights, Precision::kFloat32)};
  const std::vector<float> frames(2 * kSize.pixel_count());
  std::vector<float> volume(VolumeShape{weights.bins, kSize}.value_count());
  std::array<double, 2> least_s{};
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < generators.size(); ++k) {
      const double start_s = thread_processor_s();
      generators[k]->generate({frames, kSize}, volume);
      const double spent_s = thread_processor_s() - start_s;
      if (round == 0 || spent_s < least_s[k]) least_s[k] = spent_s;
    }
  }
  return least_s[1] / least_s[0];
}

}  // namespace

double tiles_work(const TileMask& wanted, int base_channels, Precision precision) {
  return partial_work(wanted, winograd_fits(base_channels, precision)).share;
}

double int8_speedup(const Weights& weights) {
  const OnednnSupport support = onednn_support(Precision::kInt8);
  if (!support.able) return 0;
  if (support.native) return std::numeric_limits<double>::infinity();
  static std::mutex measuring;
  static std::map<int, double> known;  // by width
  const std::lock_guard lock(measuring);
  const auto found = known.find(weights.base_channels);
  if (found != known.end()) return found->second;
  return known[weights.base_channels] = measured_int8_speedup(weights);
}

std::unique_ptr<Generator> make_onednn_generator(const Weights& weights, Precision precision) {
  require_onednn(weights, precision);
  try {
    return std::make_unique<OnednnGenerator>(weights, precision);
  } catch (const dnnl::error&) {
    std::throw_with_nested(std::runtime_error("the generator could not be set up in oneDNN"));
  }
}

}  // namespace eventgan

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"
#include "tests/benchmarks/engines/instance_threads.h"
#include "tests/benchmarks/engines/volume_error.h"

namespace eventgan {

/// What is measured: an engine in a precision, and in how many threads.
struct ContenderSetup {
  Engine engine = Engine::kTorch;
  Precision precision = Precision::kFloat32;
  int instances = 1;  ///< threads that make a volume each, at the same time
  int shrink = 0;     ///< activations are divided by two to this power
  int intra_op = 1;   ///< threads within each; more than one is what the program never does
};

struct PassTime {
  double wall_ms = 0;  ///< until all instances are done
  double cpu_ms = 0;   ///< of the whole process
};

/// What is done to frames: a random pixel of one of them gets another level of its 256, or every
/// value uniform noise of up to 1e-6, as other rounding in preparing them would.
enum class SmallChange { kOneLevelOfOnePixel, kRoundingNoise };

/// The largest of several tries, v being the volume and x the frames.
struct Amplification {
  double l2 = 0;           ///< |Δv| / |Δx|, Euclidean
  double largest = 0;      ///< max |Δv| / max v
  double relative_l2 = 0;  ///< |Δv| / |v|
};

/// One engine with its weights, on one input at a time. Not thread safe.
class EngineContender {
 public:
  /// Throws as the engine's maker.
  EngineContender(const ContenderSetup& setup, Weights weights);

  /// Whether the processor has instructions made for the precision.
  bool native() const { return native_; }
  std::string description() const { return generator_->description(); }

  /// The input of Generator::generate. Runs often enough that later passes find everything built.
  void set_input(ImageSize size, std::vector<float> frames);

  /// One forward pass of each instance. Throws std::logic_error before set_input, as does `error`.
  PassTime run();

  /// Against LibTorch in float32 on the same input.
  VolumeError error();

  /// GenerationNotes::saturated_share of the input, which must have been set, as for the next.
  double saturated_share() const;

  /// Seeded: the same changes for every engine.
  Amplification amplification(SmallChange change, int tries) const;

 private:
  void allow_intra_op_threads();
  void generate(int instance);

  ContenderSetup setup_;
  Weights weights_;
  bool native_;
  std::unique_ptr<Generator> generator_;
  ImageSize size_;
  std::vector<float> frames_;
  std::vector<std::vector<float>> volumes_;  ///< by instance
  InstanceThreads instances_;                ///< last, since its threads use all the others
};

}  // namespace eventgan

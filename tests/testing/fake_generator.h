#pragma once

#include <atomic>

#include "stages/generator/generator.h"

namespace eventgan::testing {

/// A generator with a known answer and no network: with d = next - previous at a pixel, positive
/// channel b holds max(d, 0) (b + 1)/B and negative channel b holds max(-d, 0) (b + 1)/B.
class FakeGenerator final : public Generator {
 public:
  explicit FakeGenerator(int bins = 9) : bins_(bins) {}

  /// Frames whose first previous value equals `value` get a volume with NaN in it.
  void fail_on(float value) { failing_value_ = value; }
  /// As if it had been trained.
  void train_on(GapRange gaps) { training_gaps_ = gaps; }
  std::optional<GapRange> training_gaps() const override { return training_gaps_; }
  /// As if it knew its sensor: then all values are divided by the contrast threshold of their
  /// polarity that it is told, or else by the middle of these, and are rates.
  void know(ThresholdRange thresholds) { thresholds_ = thresholds; }
  std::optional<ThresholdRange> thresholds() const override { return thresholds_; }
  /// As if it computed in 8 bits, with this share of them at the end of their range.
  void saturate(double share) { saturated_share_ = share; }
  int calls() const { return calls_; }
  /// Of the last pair; 0: it had none.
  double threshold() const { return threshold_; }

  int bins() const override { return bins_; }
  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override;
  std::string description() const override { return "fake"; }

 private:
  int bins_;
  std::optional<GapRange> training_gaps_;
  std::optional<ThresholdRange> thresholds_;
  double saturated_share_ = 0;
  float failing_value_ = -100;
  mutable std::atomic<int> calls_ = 0;
  mutable std::atomic<double> threshold_ = 0;
};

}  // namespace eventgan::testing

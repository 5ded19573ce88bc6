#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/values/weights.h"

namespace eventgan {

/// RAdam (Liu et al. 2019) with the rule of the published code: with N_sma ≥ 5 the rectified step,
/// else a plain momentum step (equations in radam.cc). Step counts and moments are all its state.
/// Not thread safe.
class RAdam {
 public:
  struct Options {
    double rate = 1e-3;     ///< ≥ 0
    double beta1 = 0;       ///< decay of the mean of gradients, in [0, 1)
    double beta2 = 0.999;   ///< decay of the mean of squared gradients, in [0, 1)
    double epsilon = 1e-8;  ///< ≥ 0
  };

  /// `parameters`: float32 leaves of any shape and device, changed in place. Throws
  /// std::invalid_argument for options out of range.
  RAdam(std::vector<at::Tensor> parameters, Options options);

  /// From the next step on.
  void set_rate(double rate) { options_.rate = rate; }

  /// One update from the parameters' gradients. A parameter without gradient is left alone, its
  /// moments and step count too.
  void step();

  /// Forgets the gradients: a parameter that no loss reaches then has none.
  void zero_grad();

  /// Writes the state into `state` under PREFIX.step ([parameters], a count each), PREFIX.m.INDEX
  /// and PREFIX.v.INDEX (the parameter's shape). Counts are exact up to 2^24, long after the last
  /// of the rule's factors has become 1.
  void save(StateDict& state, const std::string& prefix) const;

  /// Reads it back, so that steps go on to the last bit. Throws std::runtime_error naming what is
  /// missing or has another shape; then nothing has changed.
  void load(const StateDict& state, const std::string& prefix);

 private:
  std::vector<at::Tensor> parameters_;
  Options options_;
  std::vector<std::int64_t> steps_;
  std::vector<at::Tensor> first_moments_;
  std::vector<at::Tensor> second_moments_;
};

}  // namespace eventgan

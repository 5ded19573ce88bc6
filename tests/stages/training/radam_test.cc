#include "stages/training/radam.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/ones.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "manifests/values/counter_random.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

at::Tensor parameter(std::vector<float> values) {
  return at::from_blob(values.data(), {static_cast<std::int64_t>(values.size())}, at::kFloat)
      .clone()
      .requires_grad_(true);
}

void set_gradient(at::Tensor& parameter, std::vector<float> values) {
  parameter.mutable_grad() = at::from_blob(values.data(), parameter.sizes(), at::kFloat).clone();
}

std::vector<float> values_of(const at::Tensor& tensor) {
  const at::Tensor plain = tensor.detach().contiguous();
  return {plain.data_ptr<float>(), plain.data_ptr<float>() + plain.numel()};
}

/// Gradient of step `step`, the same on every machine.
std::vector<float> gradient_of(std::int64_t step, std::size_t count) {
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = static_cast<float>(CounterRandom(step).uniform(i) - 0.5);
  }
  return values;
}

TEST(RAdam, MatchesGoldenNumbers) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto file = data / "golden" / "golden.h5";
  const testing::GoldenArray parameters = testing::read_array(file, "radam/parameters");
  const testing::GoldenArray gradients = testing::read_array(file, "radam/gradients");
  const std::size_t steps = gradients.shape[0], count = gradients.shape[1];
  const auto row = [count](const testing::GoldenArray& array, std::size_t step) {
    const auto first = array.values.begin() + static_cast<std::ptrdiff_t>(step * count);
    return std::vector<float>(first, first + static_cast<std::ptrdiff_t>(count));
  };

  at::Tensor trained = parameter(row(parameters, 0));
  RAdam optimizer({trained}, {.rate = 0.01, .beta1 = 0, .beta2 = 0.999, .epsilon = 1e-8});
  for (std::size_t step = 0; step < steps; ++step) {
    set_gradient(trained, row(gradients, step));
    optimizer.step();
    const std::vector<float> expected = row(parameters, step + 1), values = values_of(trained);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_NEAR(values[i], expected[i], 1e-6 * std::abs(expected[i]) + 1e-8)
          << "step " << step << ", parameter " << i;
    }
  }
}

// β₂ = 0.999 makes N 1, 2, 3, 4, 5 but for a little less, and so 6 the first step with N ≥ 5:
// N(5) = 1999 - 10 · 0.999⁵ / (1 - 0.999⁵) = 4.996, N(6) = 5.994.
TEST(RAdam, TakesMomentumStepsUntilTheAverageIsLongEnough) {
  at::Tensor trained = parameter({1});
  RAdam optimizer({trained}, {.rate = 0.1, .beta1 = 0, .beta2 = 0.999});
  double expected = 1;
  for (int step = 1; step <= 5; ++step) {
    set_gradient(trained, {0.5f});
    optimizer.step();
    expected -= 0.1 * 0.5;
    EXPECT_NEAR(trained.item<double>(), expected, 1e-6) << step;
  }
  // The gradient never changed, so √v = 0.5 √(1 - β₂⁶) and the bias cancels: the step is rate times
  // what remains of r, √((N - 4)(N - 2) N∞ / ((N∞ - 4)(N∞ - 2) N)).
  const double decay = std::pow(0.999, 6), n = 1999 - 12 * decay / (1 - decay);
  expected -= 0.1 * std::sqrt((n - 4) * (n - 2) * 1999 / (1995.0 * 1997 * n));
  set_gradient(trained, {0.5f});
  optimizer.step();
  EXPECT_NEAR(trained.item<double>(), expected, 1e-6);
}

TEST(RAdam, UndoesTheBiasOfMomentum) {
  at::Tensor trained = parameter({0});
  RAdam optimizer({trained}, {.rate = 1, .beta1 = 0.9, .beta2 = 0.999});
  set_gradient(trained, {2});
  optimizer.step();
  EXPECT_NEAR(trained.item<double>(), -2, 1e-6);  // m = 0.2, 1 - 0.9 = 0.1
  set_gradient(trained, {0});
  optimizer.step();
  EXPECT_NEAR(trained.item<double>(), -2 - 0.18 / 0.19, 1e-6);
}

TEST(RAdam, NeverRectifiesWithoutMemoryOfSquares) {
  at::Tensor trained = parameter({0});
  RAdam optimizer({trained}, {.rate = 1, .beta1 = 0, .beta2 = 0});  // N∞ = 1
  for (int step = 1; step <= 20; ++step) {
    set_gradient(trained, {0.25f});
    optimizer.step();
    EXPECT_EQ(trained.item<float>(), -0.25f * static_cast<float>(step));
  }
}

TEST(RAdam, StaysFiniteOnGradientsOfZeroAndTakesANewRate) {
  at::Tensor trained = parameter({3});
  RAdam optimizer({trained}, {});
  for (int step = 0; step < 20; ++step) {
    set_gradient(trained, {0});
    optimizer.step();
  }
  EXPECT_EQ(trained.item<float>(), 3);
  optimizer.set_rate(0);
  set_gradient(trained, {1});
  optimizer.step();
  EXPECT_EQ(trained.item<float>(), 3);
}

TEST(RAdam, LeavesAParameterWithoutGradientAlone) {
  at::Tensor often = parameter({1, 2}), seldom = parameter({1, 2}), alone = parameter({1, 2});
  RAdam optimizer({often, seldom}, {}), lonely({alone}, {});
  for (std::int64_t step = 0; step < 20; ++step) {
    optimizer.zero_grad();
    set_gradient(often, gradient_of(step, 2));
    if (step % 2 == 0) {
      set_gradient(seldom, gradient_of(step, 2));
      set_gradient(alone, gradient_of(step, 2));
      lonely.step();
    }
    optimizer.step();
  }
  EXPECT_EQ(values_of(seldom), values_of(alone)) << "its own count of steps, its own moments";
  EXPECT_NE(values_of(often), values_of(alone));
}

TEST(RAdam, ForgetsGradients) {
  at::Tensor trained = parameter({1});
  RAdam optimizer({trained}, {});
  set_gradient(trained, {1});
  optimizer.zero_grad();
  EXPECT_FALSE(trained.grad().defined());
  optimizer.step();
  EXPECT_EQ(trained.item<float>(), 1);
}

TEST(RAdam, MinimisesAParabola) {
  at::Tensor trained = parameter({1, -2, 3});
  RAdam optimizer({trained}, {.rate = 0.05});
  for (int step = 0; step < 400; ++step) {
    optimizer.zero_grad();
    (trained * trained).sum().backward();
    optimizer.step();
  }
  EXPECT_LT(trained.abs().max().item<float>(), 0.1f);
}

TEST(RAdam, ResumesToTheLastBit) {
  const RAdam::Options options{.rate = 0.01, .beta1 = 0.5, .beta2 = 0.99};
  for (const std::int64_t stop : {0, 3, 9}) {
    at::Tensor whole = parameter({1, 2, 3}), scalar = parameter({4});
    RAdam uninterrupted({whole, scalar}, options);
    StateDict state;
    at::Tensor resumed, resumed_scalar;
    for (std::int64_t step = 0; step < 15; ++step) {
      if (step == stop) {
        uninterrupted.save(state, "optimizer.flow");
        resumed = whole.detach().clone().requires_grad_(true);
        resumed_scalar = scalar.detach().clone().requires_grad_(true);
      }
      set_gradient(whole, gradient_of(step, 3));
      if (step % 3 != 0) set_gradient(scalar, gradient_of(step, 1));
      uninterrupted.step();
      uninterrupted.zero_grad();
    }
    RAdam second({resumed, resumed_scalar}, options);
    second.load(state, "optimizer.flow");
    for (std::int64_t step = stop; step < 15; ++step) {
      set_gradient(resumed, gradient_of(step, 3));
      if (step % 3 != 0) set_gradient(resumed_scalar, gradient_of(step, 1));
      second.step();
      second.zero_grad();
    }
    EXPECT_EQ(values_of(resumed), values_of(whole)) << stop;
    EXPECT_EQ(values_of(resumed_scalar), values_of(scalar)) << stop;
  }
}

TEST(RAdam, SavesUnderThePromisedNames) {
  at::Tensor matrix = at::zeros({2, 3}).requires_grad_(true), vector = parameter({1});
  RAdam optimizer({matrix, vector}, {});
  set_gradient(matrix, {1, 2, 3, 4, 5, 6});
  optimizer.step();
  StateDict state;
  optimizer.save(state, "p");
  ASSERT_EQ(state.size(), 5u);
  EXPECT_EQ(state.at("p.step").values, (std::vector<float>{1, 0}));
  EXPECT_EQ(state.at("p.m.0").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_EQ(state.at("p.m.0").values, (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(state.at("p.v.1").values, (std::vector<float>{0}));
}

TEST(RAdam, RefusesAStateThatDoesNotFitAndKeepsItsOwn) {
  at::Tensor trained = parameter({1, 2});
  RAdam optimizer({trained}, {});
  set_gradient(trained, {1, 1});
  optimizer.step();
  StateDict good;
  optimizer.save(good, "p");

  const auto expect_refused = [&](const StateDict& state, const std::string& name) {
    try {
      optimizer.load(state, "p");
      ADD_FAILURE() << "expected an error about " << name;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
    StateDict kept;
    optimizer.save(kept, "p");
    EXPECT_EQ(kept.at("p.step").values, good.at("p.step").values);
    EXPECT_EQ(kept.at("p.m.0").values, good.at("p.m.0").values);
  };
  for (const std::string name : {"p.step", "p.m.0", "p.v.0"}) {
    StateDict state = good;
    state.erase(name);
    expect_refused(state, name);
    state[name] = {{1, 1}, {0}};
    expect_refused(state, name);
    state[name] = {good.at(name).shape, {}};
    expect_refused(state, name);
  }
}

TEST(RAdam, RefusesOptionsOutOfRange) {
  const double nan = std::nan("");
  for (const RAdam::Options& options : {RAdam::Options{.rate = -1},
                                        {.rate = nan},
                                        {.beta1 = 1},
                                        {.beta1 = -0.1},
                                        {.beta2 = 1},
                                        {.beta2 = nan},
                                        {.epsilon = -1}}) {
    EXPECT_THROWS(RAdam({}, options), std::invalid_argument,
                  "expected rate and epsilon >= 0 and betas in [0, 1)");
  }
}

}  // namespace
}  // namespace eventgan

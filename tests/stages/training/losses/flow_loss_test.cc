#include "stages/training/losses/flow_loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/ones.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/stages/training/losses/loss_cases.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

using testing::golden_tensor;
using testing::random_tensor;
using testing::tensor_of;

double rho(double error) { return std::pow(error * error + 1e-10, 0.45); }

/// Two scales on frames of 5x7.
std::vector<at::Tensor> small_flows(double largest) {
  return {largest * random_tensor({2, 2, 2, 3}, 11), largest * random_tensor({2, 2, 5, 7}, 12)};
}

TEST(FlowLoss, MatchesGoldenNumbers) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const at::Tensor previous = golden_tensor("losses/image/a").expand({2, 1, 64, 96});
  const at::Tensor next = golden_tensor("losses/image/b").expand({2, 1, 64, 96});
  std::vector<at::Tensor> flows;
  for (const char* scale : {"0", "1", "2", "3"}) {
    flows.push_back(golden_tensor(std::string("losses/flow_scaled/flow/") + scale));
  }
  // The published code weights each sample with the masks of the whole batch.
  const at::Tensor mask = golden_tensor("losses/flow_scaled/mask").sum(0, true);
  const FlowLoss loss = multi_scale_flow_loss(previous, next, flows, mask);
  const auto expect_near = [](const at::Tensor& value, const char* name) {
    const double expected = golden_tensor(name).item<double>();
    EXPECT_NEAR(value.item<double>(), expected, 2e-6 * expected) << name;
  };
  expect_near(loss.photometric, "losses/flow_scaled/photometric");
  expect_near(loss.smoothness, "losses/flow_scaled/smoothness");
  const at::Tensor warped = golden_tensor("losses/flow_scaled/warped_last");
  EXPECT_LT((loss.warped - warped).abs().max().item<double>(), 1e-5);
}

// Four pixels in a row, each looked up at its right neighbour's middle, pixel j + 1, which lies at
// (j + 1.5) / 4 of the width, while pixel j's own place is j / 3. The last leaves the frame.
TEST(FlowLoss, LooksUpTheRightNeighbour) {
  std::vector<float> flow(8, 0.5f);  // The middle of the only row lies at 0.5, its place is 0.
  for (std::size_t j = 0; j < 4; ++j) {
    const auto pixel = static_cast<float>(j);
    flow[j] = (pixel + 1.5f) / 4 - pixel / 3;
  }
  const FlowLoss loss = multi_scale_flow_loss(tensor_of({1, 1, 1, 4}, {0.9f, 0.1f, 0.4f, -0.7f}),
                                              tensor_of({1, 1, 1, 4}, {0, 0, 0, 9}),
                                              {tensor_of({1, 2, 1, 4}, flow)}, at::ones({1, 1, 4}));
  const at::Tensor expected = tensor_of({1, 1, 1, 4}, {0.1f, 0.4f, -0.7f, 0});
  EXPECT_LT((loss.warped - expected).abs().max().item<float>(), 1e-6f);
  EXPECT_NEAR(loss.photometric.item<double>(), (rho(0.1) + rho(0.4) + rho(0.7)) / 3, 1e-6);
  // Three differences of 1/4 - 1/3 among eight in x, none in y.
  EXPECT_NEAR(loss.smoothness.item<double>(), ((3 * rho(1.0 / 12) + 5 * rho(0)) / 8 + rho(0)) / 2,
              1e-6);
}

TEST(FlowLoss, CountsPlacesLeftOfTheFrameAsThePublishedCodeDoes) {
  const at::Tensor previous = at::ones({1, 1, 1, 1});
  const auto photometric = [&](float u) {
    return multi_scale_flow_loss(previous, previous, {tensor_of({1, 2, 1, 1}, {u, 0.5f})},
                                 at::ones({1, 1, 1}))
        .photometric.item<double>();
  };
  EXPECT_NEAR(photometric(0.5f), rho(0), 1e-7);
  EXPECT_NEAR(photometric(-0.9f), rho(1), 1e-6);  // black against white
  EXPECT_EQ(photometric(-1.1f), 0);
  EXPECT_EQ(photometric(1.1f), 0);
}

TEST(FlowLoss, WeighsScalesByHalves) {
  const at::Tensor frame = at::zeros({1, 1, 3, 5});
  const std::vector<at::Tensor> flows{at::zeros({1, 2, 1, 1}), at::zeros({1, 2, 2, 3}),
                                      at::zeros({1, 2, 3, 5})};
  const FlowLoss loss = multi_scale_flow_loss(frame, frame, flows, at::ones({1, 1, 3, 5}));
  EXPECT_NEAR(loss.photometric.item<double>(), 1.75 * rho(0), 1e-9);
  EXPECT_NEAR(loss.smoothness.item<double>(), 1.75 * rho(0), 1e-9);
}

TEST(FlowLoss, GivesEachSampleItsOwnMask) {
  const at::Tensor frames = random_tensor({2, 1, 5, 7}, 1), next = random_tensor({2, 1, 5, 7}, 2);
  const std::vector<at::Tensor> flows = small_flows(0.2);
  const auto photometric = [&](const at::Tensor& mask) {
    return multi_scale_flow_loss(frames, next, flows, mask).photometric.item<double>();
  };
  at::Tensor first = at::zeros({2, 5, 7}), second = at::zeros({2, 5, 7});
  first[0].fill_(1);
  second[1].fill_(1);
  const double all = photometric(at::ones({1, 5, 7}));
  EXPECT_GT(photometric(first), 0);
  EXPECT_GT(photometric(second), 0);
  EXPECT_NEAR(photometric(first) + photometric(second), all, 1e-12);
  EXPECT_NEAR(photometric((first + second) > 0), all, 1e-12) << "a mask of bool";
}

TEST(FlowLoss, IsZeroWhereNothingCounts) {
  const at::Tensor frame = at::ones({2, 1, 5, 7}, at::kDouble);
  std::vector<at::Tensor> flows = small_flows(0.2);
  for (at::Tensor& flow : flows) flow.requires_grad_(true);
  const FlowLoss loss = multi_scale_flow_loss(frame, -frame, flows, at::zeros({2, 5, 7}));
  EXPECT_EQ(loss.photometric.item<double>(), 0);
  loss.photometric.backward();
  for (const at::Tensor& flow : flows) EXPECT_EQ(flow.grad().abs().sum().item<double>(), 0);
}

TEST(FlowLoss, HasTheGradientOfDifferences) {
  const at::Tensor previous = random_tensor({2, 1, 5, 7}, 3), next = random_tensor({2, 1, 5, 7}, 4);
  const at::Tensor mask = random_tensor({2, 5, 7}, 5) > -0.5;
  const std::vector<at::Tensor> flows = small_flows(0.4);
  for (std::size_t scale = 0; scale < flows.size(); ++scale) {
    SCOPED_TRACE(scale);
    testing::expect_gradient_of_differences(
        [&](const at::Tensor& flow) {
          std::vector<at::Tensor> moved = flows;
          moved[scale] = flow;
          const FlowLoss loss = multi_scale_flow_loss(previous, next, moved, mask);
          return loss.photometric + 0.5 * loss.smoothness;
        },
        flows[scale]);
  }
}

TEST(FlowLoss, LetsNanThrough) {
  at::Tensor frame = at::zeros({1, 1, 3, 4});
  const at::Tensor nan = frame / frame;
  const std::vector<at::Tensor> flow{at::zeros({1, 2, 3, 4})};
  const at::Tensor mask = at::ones({1, 3, 4});
  const auto photometric = [&](const at::Tensor& previous, const at::Tensor& next) {
    return multi_scale_flow_loss(previous, next, flow, mask).photometric.item<float>();
  };
  EXPECT_TRUE(std::isnan(photometric(nan, frame)));
  EXPECT_TRUE(std::isnan(photometric(frame, nan)));
  const std::vector<at::Tensor> nan_flow{nan.expand({1, 2, 3, 4})};
  EXPECT_TRUE(
      std::isnan(multi_scale_flow_loss(frame, frame, nan_flow, mask).smoothness.item<float>()));
}

TEST(FlowLoss, RefusesShapesThatDoNotFit) {
  const at::Tensor frame = at::zeros({2, 1, 3, 4});
  const at::Tensor mask = at::ones({2, 3, 4});
  const std::vector<at::Tensor> flow{at::zeros({2, 2, 3, 4})};
  EXPECT_NO_THROW(multi_scale_flow_loss(frame, frame, flow, mask));
  EXPECT_THROW(multi_scale_flow_loss(frame, frame, {}, mask), std::invalid_argument);
  EXPECT_THROW(multi_scale_flow_loss(frame, frame[0], flow, mask), std::invalid_argument);
  EXPECT_THROW(multi_scale_flow_loss(frame, frame, {frame}, mask), std::invalid_argument);
  EXPECT_THROW(multi_scale_flow_loss(frame, frame, flow, at::ones({3, 3, 4})),
               std::invalid_argument);
  EXPECT_THROW(multi_scale_flow_loss(frame, frame, flow, at::ones({})), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan

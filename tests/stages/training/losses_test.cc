#include "stages/training/losses.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/full.h>
#include <ATen/ops/ones.h>
#include <ATen/ops/zeros.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/stages/training/loss_cases.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::golden_tensor;
using testing::random_tensor;
using testing::tensor_of;

/// Gaussian-weighted sum of f(y, x) over the 11x11 pixels around one, as far as they exist.
template <typename Function>
double around(int y, int x, int height, int width, const Function& f) {
  double sum = 0, weights = 0;
  for (int dy = -5; dy <= 5; ++dy) {
    for (int dx = -5; dx <= 5; ++dx) {
      const double weight = std::exp(-(dy * dy + dx * dx) / 4.5);
      weights += weight;
      const int row = y + dy, column = x + dx;
      if (row >= 0 && row < height && column >= 0 && column < width) sum += weight * f(row, column);
    }
  }
  return sum / weights;
}

/// The definition, pixel by pixel; [1, 1, H, W] float64.
double ssim_by_definition(const at::Tensor& first, const at::Tensor& second) {
  const int height = static_cast<int>(first.size(2)), width = static_cast<int>(first.size(3));
  const auto a = first.accessor<double, 4>(), b = second.accessor<double, 4>();
  double sum = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto mean = [&](const auto& f) { return around(y, x, height, width, f); };
      const double mean_a = mean([&](int r, int c) { return a[0][0][r][c]; });
      const double mean_b = mean([&](int r, int c) { return b[0][0][r][c]; });
      const double aa = mean([&](int r, int c) { return a[0][0][r][c] * a[0][0][r][c]; });
      const double bb = mean([&](int r, int c) { return b[0][0][r][c] * b[0][0][r][c]; });
      const double ab = mean([&](int r, int c) { return a[0][0][r][c] * b[0][0][r][c]; });
      sum += (2 * mean_a * mean_b + 1e-4) * (2 * (ab - mean_a * mean_b) + 9e-4) /
             ((mean_a * mean_a + mean_b * mean_b + 1e-4) *
              (aa - mean_a * mean_a + bb - mean_b * mean_b + 9e-4));
    }
  }
  return sum / (height * width);
}

// In float32 a variance is the small difference of large numbers: the golden numbers themselves are
// 2e-6 away from what float64 gives.
TEST(Ssim, MatchesGoldenNumbersWithinTheirRounding) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const at::Tensor a = golden_tensor("losses/image/a"), b = golden_tensor("losses/image/b");
  const double similarity = ssim(a, b).item<double>();
  EXPECT_NEAR(similarity, golden_tensor("losses/image/ssim").item<double>(), 4e-6);
  EXPECT_NEAR(image_loss(a, b).item<double>(),
              golden_tensor("losses/image/l1_minus_ssim").item<double>(), 4e-6);
  EXPECT_NEAR(similarity, ssim(a.to(at::kDouble), b.to(at::kDouble)).item<double>(), 2e-6);
}

TEST(Ssim, IsWhatTheDefinitionSays) {
  for (const std::vector<std::int64_t>& shape :
       {std::vector<std::int64_t>{1, 1, 1, 1}, {1, 1, 4, 13}, {1, 1, 17, 5}}) {
    const at::Tensor a = random_tensor(shape, 1);
    const at::Tensor b = 0.5 * a + 0.5 * random_tensor(shape, 2);
    EXPECT_NEAR(ssim(a, b).item<double>(), ssim_by_definition(a, b), 1e-12);
  }
}

TEST(Ssim, IsOneForEqualImages) {
  const at::Tensor image = random_tensor({3, 1, 13, 7}, 3).to(at::kFloat);
  EXPECT_NEAR(ssim(image, image).item<double>(), 1, 1e-6);
  EXPECT_NEAR(image_loss(image, image).item<double>(), -1, 1e-6);
  for (const float grey : {-1.0f, 0.0f, 0.3f, 1.0f}) {
    const at::Tensor constant = at::full({1, 1, 20, 20}, grey);
    EXPECT_NEAR(ssim(constant, constant).item<double>(), 1, 1e-6) << grey;
  }
}

TEST(Ssim, OfConstantImagesIsWhatTheDefinitionSays) {
  // Their variance is rounding alone, and may come out below zero.
  for (const auto& [a, b] :
       {std::pair{0.0, 0.0}, {1.0, 1.0}, {-1.0, 1.0}, {0.0, 1.0}, {0.3, 0.3}}) {
    const at::Tensor first = at::full({1, 1, 13, 14}, a, at::kDouble).requires_grad_();
    const at::Tensor second = at::full({1, 1, 13, 14}, b, at::kDouble);
    const double expected = ssim_by_definition(first, second);
    EXPECT_NEAR(ssim(first.to(at::kFloat), second.to(at::kFloat)).item<double>(), expected, 1e-5);
    ssim(first.to(at::kFloat), second.to(at::kFloat)).backward();
    EXPECT_TRUE(at::isfinite(first.grad()).all().item<bool>()) << a << " " << b;
  }
}

TEST(ImageLoss, IsTheMeanDifferenceLessTheSimilarityOfImagesOfOneShape) {
  const at::Tensor black = at::zeros({2, 1, 6, 6}, at::kDouble);
  EXPECT_NEAR(image_loss(black + 0.25, black).item<double>(),
              0.25 - ssim(black + 0.25, black).item<double>(), 1e-12);
  const at::Tensor images = at::zeros({2, 1, 4, 4});
  EXPECT_THROWS(image_loss(images, at::zeros({1, 1, 4, 4})), std::invalid_argument,
                "expected shape [2, 1, 4, 4], got [1, 1, 4, 4] (the image to");
  EXPECT_THROWS(ssim(images, at::zeros({2, 1, 4, 5})), std::invalid_argument,
                "expected shape [2, 1, 4, 4], got [2, 1, 4, 5] (the image to");
  EXPECT_THROWS(ssim(at::zeros({2, 3, 4, 4}), at::zeros({2, 3, 4, 4})), std::invalid_argument,
                "expected shape [-1, 1, -1, -1], got [2, 3, 4, 4] (an image");
}

TEST(ImageLoss, HasTheGradientOfDifferences) {
  const at::Tensor target = random_tensor({2, 1, 5, 6}, 4);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& image) { return image_loss(image, target); },
      random_tensor({2, 1, 5, 6}, 5));
}

TEST(ImageLoss, LetsNanThrough) {
  const at::Tensor image = at::zeros({1, 1, 20, 20});
  at::Tensor spoiled = image.clone();
  spoiled[0][0][0][0].fill_(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(image_loss(spoiled, image).item<double>()));
  EXPECT_TRUE(std::isnan(ssim(image, spoiled).item<double>()));
}

TEST(ReconstructionLoss, EnlargesAndWeighsScalesByHalves) {
  const at::Tensor target = random_tensor({2, 1, 5, 6}, 1);
  const at::Tensor coarse = random_tensor({2, 1, 1, 1}, 2), middle = random_tensor({2, 1, 5, 2}, 3),
                   fine = random_tensor({2, 1, 5, 6}, 4);
  // Three columns of the target to one of `middle`.
  const at::Tensor enlarged = middle.unsqueeze(4).expand({2, 1, 5, 2, 3}).reshape({2, 1, 5, 6});
  const at::Tensor expected = 0.25 * image_loss(coarse.expand_as(target), target) +
                              0.5 * image_loss(enlarged, target) + image_loss(fine, target);
  EXPECT_NEAR(multi_scale_reconstruction_loss({coarse, middle, fine}, target).item<double>(),
              expected.item<double>(), 1e-12);
  EXPECT_NEAR(multi_scale_reconstruction_loss({target}, target).item<double>(), -1, 1e-12);
}

TEST(ReconstructionLoss, HasTheGradientOfDifferences) {
  const at::Tensor target = random_tensor({1, 1, 5, 3}, 5), fine = random_tensor({1, 1, 5, 3}, 6);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& coarse) {
        return multi_scale_reconstruction_loss({coarse, fine}, target);
      },
      random_tensor({1, 1, 3, 2}, 7));
}

TEST(ReconstructionLoss, RefusesShapesThatDoNotFit) {
  const at::Tensor target = at::zeros({2, 1, 4, 4});
  EXPECT_THROWS(multi_scale_reconstruction_loss({}, target), std::invalid_argument,
                "expected images of at least one scale, got none");
  EXPECT_THROWS(multi_scale_reconstruction_loss({at::zeros({1, 1, 4, 4})}, target),
                std::invalid_argument, "expected shape [2, 1, -1, -1], got [1, 1, 4, 4] (a");
  EXPECT_THROWS(multi_scale_reconstruction_loss({target}, target[0]), std::invalid_argument,
                "expected shape [-1, 1, -1, -1], got [1, 4, 4] (the image to");
}

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
  // Where it is looked up is a float32 in [-1, 1] of 96 pixels, after a few roundings in x and in y
  // of 96/2 * 2^-24 = 3e-6 pixels each; neighbouring pixels differ by up to 2.
  EXPECT_LT((loss.warped - warped).abs().max().item<double>(), 5e-5);
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

TEST(FlowLoss, WeighsScalesByHalvesAndPlacesLeftOfTheFrameAsPublished) {
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
  EXPECT_THROWS(multi_scale_flow_loss(frame, frame, {}, mask), std::invalid_argument,
                "expected flow of at least one scale, got none");
  EXPECT_THROWS(multi_scale_flow_loss(frame, frame[0], flow, mask), std::invalid_argument,
                "expected shape [2, 1, 3, 4], got [1, 3, 4] (the next frame;");
  EXPECT_THROWS(multi_scale_flow_loss(frame, frame, {frame}, mask), std::invalid_argument,
                "expected shape [2, 2, -1, -1], got [2, 1, 3, 4] (a flow;");
  EXPECT_THROWS(multi_scale_flow_loss(frame, frame, flow, at::ones({3, 3, 4})),
                std::invalid_argument, "expected shape [2, 1, 3, 4], got [3, 1, 3, 4] (the flow");
  EXPECT_THROWS(multi_scale_flow_loss(frame, frame, flow, at::ones({})), std::invalid_argument,
                "expected shape [2, 1, 3, 4], got [] (the flow loss's mask;");
}

TEST(VolumeLoss, IsTheMeanDifferenceWeightedByTheQuantile) {
  const at::Tensor generated = tensor_of({1, 2, 1, 2}, {0, 1, 0.5f, 0.25f});
  const at::Tensor real = tensor_of({1, 2, 1, 2}, {1, 1, 0, 0.75f});
  EXPECT_FLOAT_EQ(volume_loss(generated, real, 0.5).item<float>(),
                  0.5f);  // (1 + 0 + 1/2 + 1/2) / 4
  EXPECT_EQ(volume_loss(real, real, 0.8).item<float>(), 0);
  const at::Tensor empty = at::zeros({1, 2, 1, 2});
  const at::Tensor full = at::ones({1, 2, 1, 2});
  EXPECT_FLOAT_EQ(volume_loss(empty, full, 0.8).item<float>(), 1.6f);  // 2 q
  EXPECT_FLOAT_EQ(volume_loss(full, empty, 0.8).item<float>(), 0.4f);  // 2 (1 - q)
}

TEST(CountLoss, DoesNotAskWhenTheEventsCame) {
  // Two bins of positive, two of negative polarity, one pixel.
  const at::Tensor early = tensor_of({1, 4, 1, 1}, {1, 0, 0, 0.5f});
  const at::Tensor late = tensor_of({1, 4, 1, 1}, {0, 1, 0.5f, 0});
  const at::Tensor swapped = tensor_of({1, 4, 1, 1}, {0, 0.5f, 1, 0});
  EXPECT_EQ(count_loss(early, late, 0.5).item<float>(), 0);
  EXPECT_FLOAT_EQ(count_loss(early, swapped, 0.5).item<float>(), 0.5f);  // |1 - .5|, |.5 - 1|
}

TEST(CountLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 3);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) { return count_loss(generated, real, 0.7); },
      random_tensor({2, 4, 3, 2}, 4));
}

TEST(OverlapLoss, IsOneMinusTheF1OfPixelsThatHaveEvents) {
  // One bin a polarity, two samples of two pixels. Events are at three of the eight places; of the
  // generated one full (2), one of half weight (0.125), one where none is (0.25); below zero is
  // none.
  const at::Tensor real = tensor_of({2, 2, 1, 2}, {1, 0, 0, 0.3f, 0, 0.02f, 0, 0});
  const at::Tensor generated = tensor_of({2, 2, 1, 2}, {2, 0, 0, 0.125f, 0, -1, 0.25f, 0});
  // One bin: voxels are their sums.
  EXPECT_FLOAT_EQ(overlap_loss(generated, real).item<float>(),
                  2 * (1 - (2 * 1.5f + 1) / (2.5f + 3 + 1)));
  const at::Tensor empty = at::zeros({1, 2, 1, 2});
  EXPECT_EQ(overlap_loss(empty, empty).item<float>(), 0);
  EXPECT_GT(overlap_loss(generated, at::zeros({2, 2, 1, 2})).item<float>(), 1.4f);
  const at::Tensor early = tensor_of({1, 4, 1, 1}, {1, 0, 0, 0});
  const at::Tensor late = tensor_of({1, 4, 1, 1}, {0, 1, 0, 0});
  EXPECT_FLOAT_EQ(overlap_loss(early, late).item<float>(), 1 - 1.0f / 3);
}

TEST(OverlapLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 3) - 0.5;
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) { return overlap_loss(0.1 * generated, real); },
      random_tensor({2, 4, 3, 2}, 4));
}

/// One term of the likelihood loss.
double unlikelihood(double expected, double real) {
  return expected - real - (real + 1) * std::log((expected + 1) / (real + 1));
}

TEST(LikelihoodLoss, IsTheMeanOfItsTerms) {
  const at::Tensor generated = tensor_of({1, 2, 1, 2}, {0, 1, 0.5f, 3});
  const at::Tensor real = tensor_of({1, 2, 1, 2}, {0, 0, 0.75f, 5});
  EXPECT_NEAR(
      likelihood_loss(generated, real).item<double>(),
      (unlikelihood(0, 0) + unlikelihood(1, 0) + unlikelihood(0.5, 0.75) + unlikelihood(3, 5)) / 4,
      1e-6);
  // Both pixels of a channel are in one block.
  EXPECT_NEAR(block_likelihood_loss(generated, real).item<double>(),
              (unlikelihood(1, 0) + unlikelihood(3.5, 5.75)) / 2, 1e-6);
}

TEST(BlockLikelihoodLoss, CountsBlocksOf8By8Pixels) {
  // An event is expected where none is: in the same block, or in another one of the two times two
  // that 9x10 pixels have, cut off at the right and below.
  const at::Tensor real = at::zeros({1, 2, 9, 10});
  real[0][0][3][7] = 1;
  const auto of_event_at = [&](int y, int x) {
    const at::Tensor generated = at::zeros({1, 2, 9, 10});
    generated[0][0][y][x] = 1;
    return block_likelihood_loss(generated, real).item<double>();
  };
  for (const auto& [y, x] : {std::pair(3, 7), {0, 0}}) {
    EXPECT_NEAR(of_event_at(y, x), 0, 1e-7) << y << ", " << x;
  }
  for (const auto& [y, x] : {std::pair(3, 8), {8, 7}, {8, 9}}) {
    EXPECT_NEAR(of_event_at(y, x), (unlikelihood(1, 0) + unlikelihood(0, 1)) / (2 * 2 * 2), 1e-6)
        << y << ", " << x;
  }
}

TEST(LikelihoodLoss, IsZeroWhereAllIsAsExpected) {
  const at::Tensor real = tensor_of({1, 2, 1, 2}, {0, 1, 0.25f, 1e4f});
  EXPECT_NEAR(likelihood_loss(real, real).item<double>(), 0, 1e-6);
  EXPECT_GT(likelihood_loss(real + 0.01, real).item<double>(), 1e-6);
}

TEST(LikelihoodLoss, IsLeastWhereTheMeanOfTheCountsIsExpected) {
  // Four voxels of a mean of 1.
  const at::Tensor real = tensor_of({1, 4, 1, 1}, {0, 0, 0.5f, 3.5f});
  const auto of_constant = [&](double rate) {
    const at::Tensor generated = at::full({1, 4, 1, 1}, rate).requires_grad_();
    const at::Tensor loss = likelihood_loss(generated, real);
    loss.backward();
    return std::pair(loss.item<double>(), generated.grad().sum().item<double>());
  };
  const auto [least, slope] = of_constant(1);
  EXPECT_NEAR(slope, 0, 1e-6);
  for (const double rate : {0.0, 0.5, 0.9, 1.1, 2.0, 10.0}) {
    EXPECT_GT(of_constant(rate).first, least) << rate;
    EXPECT_EQ(of_constant(rate).second > 0, rate > 1) << rate;
  }
}

TEST(LikelihoodLoss, HasItsGradientAtZeroAndBelow) {
  // (λ - real) / (λ + 1) of each of the voxels, of which there are six; below zero as at zero.
  const at::Tensor generated = tensor_of({1, 6, 1, 1}, {0, 0, -0.3f, -50, 1, 1});
  generated.set_requires_grad(true);
  const at::Tensor real = tensor_of({1, 6, 1, 1}, {0, 2, 2, 0, 0, 1});
  const at::Tensor loss = likelihood_loss(generated, real);
  EXPECT_NEAR(
      loss.item<double>(),
      (2 * unlikelihood(0, 0) + 2 * unlikelihood(0, 2) + unlikelihood(1, 0) + unlikelihood(1, 1)) /
          6,
      1e-6);
  loss.backward();
  const at::Tensor expected = tensor_of({1, 6, 1, 1}, {0, -2, -2, 0, 0.5f, 0}) / 6;
  EXPECT_LT((generated.grad() - expected).abs().max().item<double>(), 1e-5);
}

TEST(LikelihoodLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 1) + 1;
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) {
        return likelihood_loss(generated, real) + block_likelihood_loss(generated, real);
      },
      random_tensor({2, 4, 3, 2}, 2) + 1.1);
}

TEST(LikelihoodLoss, LetsNanThroughAndRefusesOtherShapes) {
  const at::Tensor nan = tensor_of({1, 2, 1, 1}, {std::numeric_limits<float>::quiet_NaN(), 1});
  const at::Tensor zero = at::zeros({1, 2, 1, 1});
  EXPECT_TRUE(std::isnan(likelihood_loss(nan, zero).item<float>()));
  EXPECT_TRUE(std::isnan(likelihood_loss(zero, nan).item<float>()));
  EXPECT_TRUE(std::isnan(block_likelihood_loss(zero, nan).item<float>()));
  for (const auto loss : {likelihood_loss, block_likelihood_loss}) {
    EXPECT_THROWS(loss(at::zeros({2, 18, 4, 5}), at::zeros({1, 18, 4, 5})), std::invalid_argument,
                  "expected shape [2, 18, 4, 5], got [1, 18, 4, 5] (the real");
  }
}

TEST(VolumeLoss, HasTheGradientOfDifferences) {
  const at::Tensor real = random_tensor({2, 4, 3, 2}, 1);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& generated) { return volume_loss(generated, real, 0.7); },
      random_tensor({2, 4, 3, 2}, 2));
}

TEST(VolumeLosses, AreExactAndHaveFiniteGradientsForEmptyAndHugeVolumes) {
  // Two voxels of each polarity; 1e37 and four times that are float32.
  const at::Tensor empty = at::zeros({1, 4, 1, 1});
  const at::Tensor huge = at::full({1, 4, 1, 1}, 1e37);
  for (const at::Tensor& values : {empty, huge}) {
    for (const at::Tensor& real : {empty, huge}) {
      const at::Tensor generated = values.clone().requires_grad_();
      const double apart = std::abs(values[0][0].item<double>() - real[0][0].item<double>());
      const at::Tensor voxels = volume_loss(generated, real, 0.5);
      const at::Tensor counts = count_loss(generated, real, 0.5);
      const at::Tensor overlap = overlap_loss(generated, real);
      EXPECT_FLOAT_EQ(voxels.item<float>(), float(apart));
      EXPECT_FLOAT_EQ(counts.item<float>(), float(2 * apart));  // of two bins
      // 1 - (2 · 0 + 1) / (4 + 1) of the voxels, 1 - 1 / (2 + 1) of the sums.
      EXPECT_FLOAT_EQ(overlap.item<float>(), apart == 0 ? 0 : 4.0f / 5 + 2.0f / 3);
      (voxels + counts + overlap).backward();
      EXPECT_TRUE(at::isfinite(generated.grad()).all().item<bool>());
    }
  }
}

TEST(VolumeLoss, LetsNanThrough) {
  const at::Tensor nan = tensor_of({1, 1, 1, 1}, {std::numeric_limits<float>::quiet_NaN()});
  EXPECT_TRUE(std::isnan(volume_loss(nan, at::zeros({1, 1, 1, 1}), 0.5).item<float>()));
  const at::Tensor two = at::cat({nan, nan}, 1);
  EXPECT_TRUE(std::isnan(overlap_loss(two, at::zeros({1, 2, 1, 1})).item<float>()));
}

TEST(VolumeLoss, RefusesOtherShapesAndSaysWhich) {
  try {
    volume_loss(at::zeros({2, 18, 4, 5}), at::zeros({1, 18, 4, 5}), 0.5);
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "expected shape [2, 18, 4, 5], got [1, 18, 4, 5] (the real volumes; -1: any)");
  }
  EXPECT_THROWS(volume_loss(at::zeros({0, 18, 4, 5}), at::zeros({0, 18, 4, 5}), 0.5),
                std::invalid_argument, "expected shape [-1, -1, -1, -1], got [0, 18, 4, 5] (the");
}

TEST(HingeLoss, MatchesGoldenNumbers) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const at::Tensor real = golden_tensor("losses/hinge/real");
  const at::Tensor fake = golden_tensor("losses/hinge/fake");
  EXPECT_NEAR(discriminator_hinge_loss(real, fake).item<double>(),
              golden_tensor("losses/hinge/discriminator").item<double>(), 1e-6);
  EXPECT_NEAR(generator_hinge_loss(fake).item<double>(),
              golden_tensor("losses/hinge/generator").item<double>(), 1e-6);
}

TEST(HingeLoss, CountsOnlyWhatIsOnTheWrongSideOfTheMargin) {
  const at::Tensor real = tensor_of({1, 1, 2, 2}, {-1, 0, 1, 5});  // 2, 1, 0, 0
  const at::Tensor fake = tensor_of({1, 1, 1, 2}, {-3, 0.5f});     // 0, 1.5
  EXPECT_FLOAT_EQ(discriminator_hinge_loss(real, fake).item<float>(), 0.75f + 0.75f);
  EXPECT_FLOAT_EQ(generator_hinge_loss(real).item<float>(), -1.25f);
  const at::Tensor logits = tensor_of({2, 1, 1, 1}, {0, 0});
  EXPECT_EQ(discriminator_hinge_loss(logits, logits).item<float>(), 2);
}

TEST(HingeLoss, HasTheGradientOfDifferences) {
  const at::Tensor fixed = random_tensor({2, 1, 3, 2}, 1).mul(2);
  const at::Tensor at = random_tensor({2, 1, 3, 2}, 2).mul(2);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& x) { return discriminator_hinge_loss(x, fixed); }, at);
  testing::expect_gradient_of_differences(
      [&](const at::Tensor& x) { return discriminator_hinge_loss(fixed, x); }, at);
  testing::expect_gradient_of_differences(generator_hinge_loss, at);
}

TEST(HingeLoss, LetsNanThrough) {
  const at::Tensor logits = tensor_of({1, 1, 1, 2}, {0, std::numeric_limits<float>::quiet_NaN()});
  EXPECT_TRUE(
      std::isnan(discriminator_hinge_loss(logits, tensor_of({1, 1, 1, 1}, {0})).item<float>()));
  EXPECT_TRUE(std::isnan(generator_hinge_loss(logits).item<float>()));
}

}  // namespace
}  // namespace eventgan

#include "stages/generator/onednn/calibrator.h"

#include <algorithm>
#include <cmath>
#include <dnnl.hpp>
#include <iterator>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/values/events.h"
#include "stages/generator/flush_subnormals.h"
#include "stages/generator/generator.h"
#include "stages/generator/onednn/detail/network_plan.h"
#include "stages/generator/onednn/onednn_generator.h"

namespace eventgan {
namespace {

constexpr double kRidge = 0.1;
constexpr double kRidgeOfMean = 1e-3;

/// A mean variance below this part of the mean square is what rounding leaves of none.
constexpr double kNoVariance = 1e-9;

cv::Mat mean_of(const std::vector<double>& sums, double pixels, int columns) {
  const int rows = static_cast<int>(sums.size()) / columns;
  return cv::Mat(rows, columns, CV_64F, const_cast<double*>(sums.data())) / pixels;
}

std::vector<float> values_of(const cv::Mat& matrix) {
  return {matrix.begin<double>(), matrix.end<double>()};
}

void fit_lost_part(const TensorSums& sums, TensorStatistics& statistics) {
  const auto channels = static_cast<int>(sums.lost.size());
  const cv::Mat kept = mean_of(sums.kept, sums.pixels, 1);
  const cv::Mat lost = mean_of(sums.lost, sums.pixels, 1);
  const cv::Mat squares = mean_of(sums.kept_kept, sums.pixels, channels);
  const cv::Mat covariance = squares - kept * kept.t();
  const cv::Mat cross = mean_of(sums.lost_kept, sums.pixels, channels) - lost * kept.t();

  const cv::Mat variance = cv::max(covariance.diag(), 0);
  const double mean_variance = cv::mean(variance)[0];
  cv::Mat mixing = cv::Mat::zeros(channels, channels, CV_64F);
  if (mean_variance > kNoVariance * cv::mean(squares.diag())[0]) {
    const cv::Mat ridge = cv::Mat::diag(variance * kRidge + mean_variance * kRidgeOfMean);
    const double unit = 1 / mean_variance;  // OpenCV takes small numbers for a singular matrix
    cv::Mat transposed;
    if (!cv::solve((covariance + ridge) * unit, cross.t() * unit, transposed,
                   cv::DECOMP_CHOLESKY)) {
      throw std::runtime_error("expected a regression of " + sums.name + ", got none");
    }
    mixing = transposed.t();
  }
  statistics.offset = values_of(lost - mixing * kept);
  statistics.mixing = values_of(mixing);
}

TensorStatistics fit(const TensorSums& sums) {
  TensorStatistics statistics;
  statistics.name = sums.name;
  statistics.highest.assign(sums.highest.begin(), sums.highest.end());
  std::ranges::transform(sums.kept, std::back_inserter(statistics.mean),
                         [&](double sum) { return static_cast<float>(sum / sums.pixels); });
  if (!sums.lost.empty()) fit_lost_part(sums, statistics);
  return statistics;
}

}  // namespace

Calibration fit_calibration(const CalibrationSums& sums, std::string origin) {
  if (sums.pairs < 1 || sums.tensors.empty()) {
    throw std::invalid_argument("expected sums of at least 1 pair, got none");
  }
  Calibration calibration{sums.pairs, std::move(origin), {}};
  try {
    std::ranges::transform(sums.tensors, std::back_inserter(calibration.tensors), fit);
  } catch (const cv::Exception&) {
    std::throw_with_nested(std::runtime_error("the calibration failed in OpenCV"));
  }
  const auto base_channels = static_cast<int>(sums.tensors.front().highest.size());
  check_calibration(calibration, base_channels, "the calibration's sums");
  return calibration;
}

struct Calibrator::Network {
  explicit Network(const Weights& weights)
      : layers(weights, Precision::kFloat32, dnnl::engine(dnnl::engine::kind::cpu, 0)),
        plans(layers) {}

  NetworkLayers layers;
  PlanCache plans;
  BlockPool blocks;
};

Calibrator::Calibrator(const Weights& weights)
    : sums_(empty_calibration_sums(weights.base_channels)),
      base_channels_(weights.base_channels),
      thresholds_(weights.thresholds) {
  require_onednn(weights, Precision::kFloat32);
  try {
    network_ = std::make_unique<Network>(weights);
  } catch (const dnnl::error&) {
    std::throw_with_nested(std::runtime_error("the calibration could not be set up in oneDNN"));
  }
}

Calibrator::~Calibrator() = default;

void Calibrator::add(const GeneratorInput& input) {
  std::vector<float> volume(VolumeShape{network_->layers.bins(), input.size}.value_count());
  check_generator_spans(input, volume, network_->layers.bins());
  if (!all_finite(input.frames)) {
    throw std::runtime_error("expected finite values of the frames, got NaN or infinity");
  }
  CalibrationSums pair = empty_calibration_sums(base_channels_);
  pair.pairs = 1;
  const auto add_observed = [&](const std::string& name, std::span<const float> values) {
    add_tensor(*std::ranges::find(pair.tensors, name, &TensorSums::name), values);
  };
  std::vector<float> kept;
  const std::span<const float> planes = network_planes(input, thresholds_, kept);
  const OneOpenMpThread one_thread;
  const FlushSubnormals flush;
  try {
    const auto plan = network_->plans.plan(input.size);
    const BlockPool::Lease block = network_->blocks.take(plan->block_bytes());
    plan->run(planes.data(), volume.data(), block.data(), add_observed);
  } catch (const dnnl::error&) {
    std::throw_with_nested(std::runtime_error("the calibration failed in oneDNN"));
  }
  merge(sums_, pair);
}

Calibration Calibrator::calibration(std::string origin) const {
  return fit_calibration(sums_, std::move(origin));
}

}  // namespace eventgan

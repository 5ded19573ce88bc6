#include "stages/generator/checkpoints/fold.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace eventgan {
namespace {

constexpr double kPowerEpsilon = 1e-12;
constexpr double kBatchNormEpsilon = 1e-5;

std::string shape_text(const std::vector<std::int64_t>& shape) {
  return fmt::format("[{}]", fmt::join(shape, ", "));
}

/// The state dict with messages: every look-up states what it needs.
class FoldedState {
 public:
  FoldedState(StateDict tensors, const std::string& name)
      : tensors_(std::move(tensors)), name_(name) {}

  bool contains(const std::string& key) const { return tensors_.contains(key); }

  const std::vector<std::int64_t>& shape(const std::string& key) const {
    const auto found = tensors_.find(key);
    if (found == tensors_.end()) fail("key " + key, "none");
    return found->second.shape;
  }

  /// Takes a convolution's weight out of the state dict.
  std::vector<float> take_weight(const std::string& key, const Convolution& layer) {
    const std::int64_t side = layer.kernel;
    const std::vector<std::int64_t> wanted = {layer.out_channels, layer.in_channels, side, side};
    if (shape(key) != wanted) {
      fail("shape " + shape_text(wanted) + " of " + key, shape_text(shape(key)));
    }
    return take(key, std::size_t(layer.out_channels) * layer.in_channels * side * side);
  }

  /// Takes the values out of the state dict.
  std::vector<float> take(const std::string& key, std::size_t count) {
    auto node = tensors_.extract(key);
    if (node.empty()) fail("key " + key, "none");
    if (node.mapped().values.size() != count) {
      fail(std::to_string(count) + " values of " + key,
           std::to_string(node.mapped().values.size()));
    }
    return std::move(node.mapped().values);
  }

  /// Takes out what is known to play no part.
  void leave_out(const std::string& key) { tensors_.erase(key); }

  /// Throws if anything has not been taken: the network does what is not known here.
  void check_empty() const {
    if (!tensors_.empty()) fail("no other tensors than the generator's", tensors_.begin()->first);
  }

  [[noreturn]] void fail(const std::string& expected, const std::string& got) const {
    throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name_);
  }

 private:
  StateDict tensors_;
  std::string name_;
};

std::vector<double> normalized(std::vector<double> vector) {
  double squares = 0;
  for (const double value : vector) squares += value * value;
  const double norm = std::sqrt(squares) + kPowerEpsilon;
  for (double& value : vector) value /= norm;
  return vector;
}

/// σ = uᵀ W v after one power iteration from the stored u; W is [rows, columns].
double spectral_sigma(const std::vector<float>& matrix, const std::vector<float>& stored_u) {
  const std::size_t rows = stored_u.size();
  const std::size_t columns = matrix.size() / rows;
  std::vector<double> v(columns, 0.0);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) v[c] += double(matrix[r * columns + c]) * stored_u[r];
  }
  v = normalized(std::move(v));
  std::vector<double> product(rows, 0.0);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) product[r] += double(matrix[r * columns + c]) * v[c];
  }
  const std::vector<double> u = normalized(product);
  double sigma = 0;
  for (std::size_t r = 0; r < rows; ++r) sigma += u[r] * product[r];
  return sigma;
}

/// Where the published code keeps a layer's parts: ConvLayer has conv2d and norm_layer,
/// ResidualBlock convN and bnN. A network that was folded elsewhere may leave conv2d out.
struct LayerKeys {
  std::string convolution;
  std::string batch_norm;
};

LayerKeys layer_keys(const FoldedState& state, const std::string& name) {
  if (name.starts_with("resblocks.")) {
    std::string norm = name;
    norm.replace(norm.rfind("conv"), 4, "bn");
    return {name, norm};
  }
  const bool bare = state.contains(name + ".weight");
  return {bare ? name : name + ".conv2d", name + ".norm_layer"};
}

std::vector<double> effective_weight(FoldedState& state, const std::string& key,
                                     const Convolution& layer) {
  const std::string module = key + ".module";
  if (!state.contains(module + ".weight_bar")) {
    const std::vector<float> plain = state.take_weight(key + ".weight", layer);
    return {plain.begin(), plain.end()};
  }
  const std::vector<float> raw = state.take_weight(module + ".weight_bar", layer);
  const double sigma = spectral_sigma(raw, state.take(module + ".weight_u", layer.out_channels));
  state.leave_out(module + ".weight_v");  // follows from u
  if (!(std::abs(sigma) > 0)) {
    state.fail("a spectral norm above 0 of " + module, std::to_string(sigma));
  }
  std::vector<double> weight(raw.begin(), raw.end());
  for (double& value : weight) value /= sigma;
  return weight;
}

/// The convolution's own bias; zeros if it has none. SpectralNorm keeps it inside the module.
std::vector<double> own_bias(FoldedState& state, const std::string& key, std::size_t rows) {
  for (const std::string& place : {key + ".bias", key + ".module.bias"}) {
    if (!state.contains(place)) continue;
    const std::vector<float> stored = state.take(place, rows);
    return {stored.begin(), stored.end()};
  }
  return std::vector<double>(rows, 0.0);
}

void fold_layer(FoldedState& state, Convolution& layer) {
  const LayerKeys keys = layer_keys(state, layer.name);
  const std::size_t rows = layer.out_channels;
  const std::size_t columns = std::size_t(layer.in_channels) * layer.kernel * layer.kernel;
  const bool has_bias = state.contains(keys.convolution + ".bias") ||
                        state.contains(keys.convolution + ".module.bias");
  std::vector<double> weight = effective_weight(state, keys.convolution, layer);
  std::vector<double> bias = own_bias(state, keys.convolution, rows);
  if (state.contains(keys.batch_norm + ".weight")) {
    const auto gamma = state.take(keys.batch_norm + ".weight", rows);
    const auto beta = state.take(keys.batch_norm + ".bias", rows);
    const auto mean = state.take(keys.batch_norm + ".running_mean", rows);
    const auto variance = state.take(keys.batch_norm + ".running_var", rows);
    state.leave_out(keys.batch_norm + ".num_batches_tracked");  // of use in training only
    for (std::size_t r = 0; r < rows; ++r) {
      const double factor = gamma[r] / std::sqrt(double(variance[r]) + kBatchNormEpsilon);
      bias[r] = beta[r] + (bias[r] - mean[r]) * factor;
      for (std::size_t c = 0; c < columns; ++c) weight[r * columns + c] *= factor;
    }
  } else if (!has_bias) {
    state.fail("key " + keys.batch_norm + ".weight or " + keys.convolution + ".bias", "neither");
  }
  layer.weight.assign(weight.begin(), weight.end());
  layer.bias.assign(bias.begin(), bias.end());
}

/// Sides of a square convolution's weight, wherever the layer keeps it.
std::vector<std::int64_t> weight_shape(const FoldedState& state, const std::string& layer) {
  const std::string key = layer_keys(state, layer).convolution;
  const std::string bar = key + ".module.weight_bar";
  return state.shape(state.contains(bar) ? bar : key + ".weight");
}

}  // namespace

Weights fold_generator(StateDict tensors, const std::string& name,
                       const std::optional<ThresholdRange>& thresholds) {
  FoldedState state(std::move(tensors), name);
  Weights weights;
  weights.thresholds = thresholds;
  const int inputs = weights.inputs();
  const std::vector<std::int64_t> head = weight_shape(state, "head");
  const std::vector<std::int64_t> pred = weight_shape(state, "pred");
  if (head.size() != 4 || head[0] < 1 || head[0] > kMostBaseChannels || head[1] != inputs ||
      pred.size() != 4 || pred[0] % 2 != 0 || pred[0] < 2 || pred[0] > 2 * kMostWeightBins) {
    state.fail(fmt::format("a generator of {} inputs to 2 x bins channels", inputs),
               "another network");
  }
  weights.base_channels = static_cast<int>(head[0]);
  weights.bins = static_cast<int>(pred[0] / 2);
  weights.convolutions = network_layout(weights.base_channels, weights.bins, inputs);
  for (Convolution& layer : weights.convolutions) fold_layer(state, layer);
  state.check_empty();
  check_weights(weights, name);
  return weights;
}

}  // namespace eventgan

#include "stages/generator/fold.h"

#include <cmath>
#include <stdexcept>

namespace eventgan {
namespace {

constexpr double kPowerEpsilon = 1e-12;
constexpr double kBatchNormEpsilon = 1e-5;

/// The state dict with messages: every look-up states what it needs.
class State {
 public:
  State(const StateDict& tensors, const std::string& name) : tensors_(tensors), name_(name) {}

  bool contains(const std::string& key) const { return tensors_.count(key) != 0; }

  const NamedTensor& tensor(const std::string& key) const {
    const auto found = tensors_.find(key);
    if (found == tensors_.end()) fail("key " + key, "none");
    return found->second;
  }

  const std::vector<float>& values(const std::string& key, std::size_t count) const {
    const NamedTensor& found = tensor(key);
    if (found.values.size() != count) {
      fail(std::to_string(count) + " values of " + key, std::to_string(found.values.size()));
    }
    return found.values;
  }

  [[noreturn]] void fail(const std::string& expected, const std::string& got) const {
    throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name_);
  }

 private:
  const StateDict& tensors_;
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
/// ResidualBlock convN and bnN.
struct LayerKeys {
  std::string convolution;
  std::string batch_norm;  // empty if the layer has none
};

LayerKeys layer_keys(const std::string& name) {
  if (name == "head" || name == "pred") return {name + ".conv2d", ""};
  if (name.starts_with("resblocks.")) {
    std::string norm = name;
    norm.replace(norm.rfind("conv"), 4, "bn");
    return {name, norm};
  }
  return {name + ".conv2d", name + ".norm_layer"};
}

std::vector<double> effective_weight(const State& state, const std::string& key, std::size_t count,
                                     std::size_t rows) {
  const std::string module = key + ".module";
  const bool spectral = state.contains(module + ".weight_bar");
  const std::vector<float>& raw =
      state.values(spectral ? module + ".weight_bar" : key + ".weight", count);
  std::vector<double> weight(raw.begin(), raw.end());
  if (spectral) {
    const double sigma = spectral_sigma(raw, state.values(module + ".weight_u", rows));
    if (!(std::abs(sigma) > 0))
      state.fail("a spectral norm above 0 of " + module, std::to_string(sigma));
    for (double& value : weight) value /= sigma;
  }
  return weight;
}

void fold_layer(const State& state, Convolution& layer) {
  const LayerKeys keys = layer_keys(layer.name);
  const std::size_t rows = layer.out_channels;
  const std::size_t columns = std::size_t(layer.in_channels) * layer.kernel * layer.kernel;
  std::vector<double> weight = effective_weight(state, keys.convolution, rows * columns, rows);
  std::vector<double> bias(rows, 0.0);
  if (keys.batch_norm.empty()) {
    const auto& stored = state.values(keys.convolution + ".bias", rows);
    bias.assign(stored.begin(), stored.end());
  } else {
    const auto& gamma = state.values(keys.batch_norm + ".weight", rows);
    const auto& beta = state.values(keys.batch_norm + ".bias", rows);
    const auto& mean = state.values(keys.batch_norm + ".running_mean", rows);
    const auto& variance = state.values(keys.batch_norm + ".running_var", rows);
    for (std::size_t r = 0; r < rows; ++r) {
      const double factor = gamma[r] / std::sqrt(double(variance[r]) + kBatchNormEpsilon);
      bias[r] = beta[r] - mean[r] * factor;
      for (std::size_t c = 0; c < columns; ++c) weight[r * columns + c] *= factor;
    }
  }
  layer.weight.assign(weight.begin(), weight.end());
  layer.bias.assign(bias.begin(), bias.end());
}

}  // namespace

Weights fold_generator(const StateDict& tensors, const std::string& name) {
  const State state(tensors, name);
  const NamedTensor& head = state.tensor("head.conv2d.weight");
  const NamedTensor& pred = state.tensor("pred.conv2d.weight");
  if (head.shape.size() != 4 || head.shape[1] != 2 || pred.shape.size() != 4 ||
      pred.shape[0] % 2 != 0 || pred.shape[0] == 0) {
    state.fail("a generator of 2 frames to 2 x bins channels", "another network");
  }
  Weights weights;
  weights.base_channels = static_cast<int>(head.shape[0]);
  weights.bins = static_cast<int>(pred.shape[0] / 2);
  weights.convolutions = network_layout(weights.base_channels, weights.bins);
  for (Convolution& layer : weights.convolutions) fold_layer(state, layer);
  check_weights(weights, name);
  return weights;
}

}  // namespace eventgan

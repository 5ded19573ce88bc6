#include "tests/stages/generator/plain_network.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stages/generator/calibration.h"
#include "stages/generator/quantized_network.h"

namespace eventgan::testing {
namespace {

struct Planes {
  int channels = 0;
  ImageSize size;
  std::vector<double> values;

  double& at(int c, int y, int x) {
    return values[(static_cast<std::size_t>(c) * size.height + y) * size.width + x];
  }
  double padded(int c, int y, int x) const {
    if (y < 0 || x < 0 || y >= size.height || x >= size.width) return 0;
    return values[(static_cast<std::size_t>(c) * size.height + y) * size.width + x];
  }
};

Planes make(int channels, ImageSize size) {
  return {channels, size, std::vector<double>(channels * size.pixel_count(), 0.0)};
}

const Convolution& find(const Weights& weights, const std::string& name) {
  for (const Convolution& convolution : weights.convolutions) {
    if (convolution.name == name) return convolution;
  }
  throw std::runtime_error("no layer " + name);
}

Planes convolve(const Weights& weights, const std::string& name, const Planes& in) {
  const Convolution& layer = find(weights, name);
  const int pad = layer.kernel / 2;
  const auto side = [&](int length) {
    return (length + 2 * pad - layer.kernel) / layer.stride + 1;
  };
  Planes out = make(layer.out_channels, {side(in.size.height), side(in.size.width)});
  for (int o = 0; o < layer.out_channels; ++o) {
    for (int y = 0; y < out.size.height; ++y) {
      for (int x = 0; x < out.size.width; ++x) {
        double sum = layer.bias[o];
        for (int i = 0; i < layer.in_channels; ++i) {
          for (int ky = 0; ky < layer.kernel; ++ky) {
            for (int kx = 0; kx < layer.kernel; ++kx) {
              const std::size_t w =
                  ((std::size_t(o) * layer.in_channels + i) * layer.kernel + ky) * layer.kernel +
                  kx;
              sum += double(layer.weight[w]) *
                     in.padded(i, y * layer.stride + ky - pad, x * layer.stride + kx - pad);
            }
          }
        }
        out.at(o, y, x) = sum;
      }
    }
  }
  return out;
}

Planes activated(Planes planes, double slope) {
  for (double& value : planes.values) value = value > 0 ? value : slope * value;
  return planes;
}

Planes changed(const std::string& name, Planes planes, const TensorChange& change) {
  if (change) change(name, planes.values);
  return planes;
}

Planes residual(const Weights& weights, const std::string& block, const Planes& in,
                const TensorChange& change) {
  const std::string first = block + ".conv1";
  const Planes middle = changed(first, activated(convolve(weights, first, in), 0.0), change);
  Planes out = convolve(weights, block + ".conv2", middle);
  for (std::size_t i = 0; i < out.values.size(); ++i) out.values[i] += in.values[i];
  return changed(block, activated(std::move(out), 0.0), change);
}

/// Nearest upsampling to the skip's size, then [x, skip].
Planes joined(const Planes& x, const Planes& skip) {
  Planes out = make(x.channels + skip.channels, skip.size);
  for (int c = 0; c < out.channels; ++c) {
    for (int y = 0; y < skip.size.height; ++y) {
      for (int column = 0; column < skip.size.width; ++column) {
        out.at(c, y, column) = c < x.channels ? x.padded(c, y * x.size.height / skip.size.height,
                                                         column * x.size.width / skip.size.width)
                                              : skip.padded(c - x.channels, y, column);
      }
    }
  }
  return out;
}

}  // namespace

std::vector<float> plain_network(const Weights& weights, const std::vector<float>& planes,
                                 ImageSize size, const TensorChange& change) {
  constexpr double kSlope = 0.01;
  const auto leaky = [&](const std::string& name, const Planes& in) {
    return changed(name, activated(convolve(weights, name, in), kSlope), change);
  };
  Planes x{int(planes.size() / size.pixel_count()), size, {planes.begin(), planes.end()}};
  x = leaky("head", x);
  std::vector<Planes> skips;
  for (int level = 0; level < 4; ++level) {
    skips.push_back(x);
    x = leaky("encoders." + std::to_string(level), x);
  }
  for (const char* block : {"resblocks.0", "resblocks.1"}) x = residual(weights, block, x, change);
  for (int level = 0; level < 4; ++level) {
    x = leaky("decoders." + std::to_string(level), joined(x, skips[3 - level]));
  }
  x = activated(convolve(weights, "pred", x), 0.0);
  return {x.values.begin(), x.values.end()};
}

namespace {

/// Replaces the input channels of one tensor by what their 8-bit weights stand for.
void round_weights(Convolution& layer, const TensorUse& use, const TensorQuantization& input,
                   int largest_weight) {
  const std::size_t taps = std::size_t(layer.kernel) * layer.kernel;
  const std::size_t row = input.mean.size() * taps;
  const auto begin = [&](int out) {
    return layer.weight.begin() + (std::size_t(out) * layer.in_channels + use.first_channel) * taps;
  };
  std::vector<float> kernel;
  for (int out = 0; out < layer.out_channels; ++out) {
    kernel.insert(kernel.end(), begin(out), begin(out) + row);
  }
  const QuantizedKernel rounded =
      quantize_kernel(kernel, layer.out_channels, input.scale, input.mean, largest_weight);
  for (int out = 0; out < layer.out_channels; ++out) {
    for (std::size_t i = 0; i < row; ++i) {
      begin(out)[i] = rounded.values[out * row + i] * rounded.scales[out] / input.scale;
    }
    layer.bias[out] += rounded.bias_correction[out];
  }
}

}  // namespace

std::vector<float> plain_int8_network(const Weights& weights, const std::vector<float>& planes,
                                      ImageSize size, int largest_weight) {
  const QuantizableNetwork network = quantize_network(weights, *weights.calibration);
  Weights rounded{weights.base_channels, weights.bins, network.convolutions, {}, {}};
  for (const QuantizedTensor& tensor : quantized_tensors(weights.base_channels)) {
    for (const TensorUse& use : tensor.uses) {
      const auto layer =
          std::ranges::find(rounded.convolutions, use.convolution, &Convolution::name);
      round_weights(*layer, use, network.tensors.at(tensor.name), largest_weight);
    }
  }
  const auto store = [&](const std::string& name, std::vector<double>& values) {
    const auto tensor = network.tensors.find(name);
    if (tensor == network.tensors.end()) return;
    const double scale = tensor->second.scale;
    for (double& value : values) {
      value = scale * std::clamp(std::nearbyint(value / scale), 0.0, 255.0);
    }
  };
  return plain_network(rounded, planes, size, store);
}

}  // namespace eventgan::testing

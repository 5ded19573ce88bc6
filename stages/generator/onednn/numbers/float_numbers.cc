#include "stages/generator/decoder_kernels.h"
#include "stages/generator/onednn/numbers/layer_numbers.h"

namespace eventgan {

bool is_float32_layer(const std::string& name) { return name == "head" || name == "pred"; }

NetworkNumbers float_numbers(const Weights& weights) {
  NetworkNumbers numbers;
  for (const Convolution& convolution : weights.convolutions) {
    const std::string& name = convolution.name;
    const int out = convolution.out_channels;
    if (!name.starts_with("decoders.")) {
      numbers.layers.push_back({name,
                                out,
                                convolution.in_channels,
                                convolution.kernel,
                                convolution.weight,
                                convolution.bias,
                                {}});
      continue;
    }
    const DecoderKernels kernels = decoder_kernels(convolution);
    const int in = kernels.doubled_channels;
    numbers.layers.push_back({name + ".skip", out, out, 3, kernels.skip, convolution.bias, {}});
    numbers.layers.push_back({name + ".phases", 4 * out, in, 2, kernels.phases, {}, {}});
    numbers.layers.push_back({name + ".last_row", out, in, 3, kernels.doubled, {}, {}});
    numbers.layers.push_back({name + ".last_column", out, in, 3, kernels.transposed, {}, {}});
  }
  return numbers;
}

}  // namespace eventgan

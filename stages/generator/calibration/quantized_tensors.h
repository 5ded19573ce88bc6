#pragma once

#include <string>
#include <vector>

namespace eventgan {

/// Where a tensor enters a convolution: as its input channels from `first_channel` on.
struct TensorUse {
  std::string convolution;
  int first_channel = 0;
};

/// A tensor of the network that an 8-bit engine stores in 8 bits: what a convolution leaves behind
/// its activation.
struct QuantizedTensor {
  std::string name;      ///< the convolution that makes it, or "resblocks.N" behind the addition
  std::string producer;  ///< the convolution that makes it
  int channels = 0;
  bool leaky = false;  ///< behind a LeakyReLU, so it has small negative values; else a ReLU
  std::string addend;  ///< the tensor that is added before the activation; empty: none
  std::vector<TensorUse> uses;
};

/// The tensors, in the order in which the network makes them; [a, b] are a decoder's two inputs, a
/// upsampled, b the skip, whose channels follow a's:
///
///   head ← the frames, which are float32
///   encoders.0 ← head
///   encoders.1 ← encoders.0
///   encoders.2 ← encoders.1
///   encoders.3 ← encoders.2
///   resblocks.0.conv1 ← encoders.3
///   resblocks.0 ← conv2 of resblocks.0.conv1, plus encoders.3
///   resblocks.1.conv1 ← resblocks.0
///   resblocks.1 ← conv2 of resblocks.1.conv1, plus resblocks.0
///   decoders.0 ← [resblocks.1, encoders.2]
///   decoders.1 ← [decoders.0, encoders.1]
///   decoders.2 ← [decoders.1, encoders.0]
///
/// Float32, and so not among them: decoders.3 ← [decoders.2, head], and pred ← decoders.3.
std::vector<QuantizedTensor> quantized_tensors(int base_channels);

}  // namespace eventgan

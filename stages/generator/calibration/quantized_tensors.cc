#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan {

std::vector<QuantizedTensor> quantized_tensors(int base_channels) {
  const auto encoder = [](int level) { return "encoders." + std::to_string(level); };
  const auto decoder = [](int level) { return "decoders." + std::to_string(level); };
  const int b = base_channels;
  const int widest = 16 * b;
  return {
      {"head", "head", b, true, "", {{encoder(0), 0}, {decoder(3), 2 * b}}},
      {encoder(0), encoder(0), 2 * b, true, "", {{encoder(1), 0}, {decoder(2), 4 * b}}},
      {encoder(1), encoder(1), 4 * b, true, "", {{encoder(2), 0}, {decoder(1), 8 * b}}},
      {encoder(2), encoder(2), 8 * b, true, "", {{encoder(3), 0}, {decoder(0), 16 * b}}},
      {encoder(3), encoder(3), widest, true, "", {{"resblocks.0.conv1", 0}}},
      {"resblocks.0.conv1", "resblocks.0.conv1", widest, false, "", {{"resblocks.0.conv2", 0}}},
      {"resblocks.0", "resblocks.0.conv2", widest, false, encoder(3), {{"resblocks.1.conv1", 0}}},
      {"resblocks.1.conv1", "resblocks.1.conv1", widest, false, "", {{"resblocks.1.conv2", 0}}},
      {"resblocks.1", "resblocks.1.conv2", widest, false, "resblocks.0", {{decoder(0), 0}}},
      {decoder(0), decoder(0), 8 * b, true, "", {{decoder(1), 0}}},
      {decoder(1), decoder(1), 4 * b, true, "", {{decoder(2), 0}}},
      {decoder(2), decoder(2), 2 * b, true, "", {{decoder(3), 0}}},
  };
}

}  // namespace eventgan

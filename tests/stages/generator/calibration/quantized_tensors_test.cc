#include "stages/generator/calibration/quantized_tensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "stages/generator/weights.h"

namespace eventgan {
namespace {

TEST(QuantizedTensors, FillTheInputsOfEveryConvolutionButTheFloatOnes) {
  constexpr int kBase = 3;
  std::map<std::string, std::set<int>> read;  // convolution → its input channels that are stored
  for (const QuantizedTensor& tensor : quantized_tensors(kBase)) {
    for (const TensorUse& use : tensor.uses) {
      for (int c = 0; c < tensor.channels; ++c) {
        EXPECT_TRUE(read[use.convolution].insert(use.first_channel + c).second) << use.convolution;
      }
    }
  }
  for (const Convolution& layer : network_layout(kBase, 9)) {
    const bool reads_float = layer.name == "head" || layer.name == "pred";
    const std::size_t wanted = reads_float ? 0 : layer.in_channels;
    EXPECT_EQ(read[layer.name].size(), wanted) << layer.name;
    if (!reads_float) {
      EXPECT_EQ(*read[layer.name].rbegin(), layer.in_channels - 1) << layer.name;
    }
  }
}

TEST(QuantizedTensors, AreWhatTheirProducersMake) {
  const auto layout = network_layout(2, 9);
  std::set<std::string> names;
  for (const QuantizedTensor& tensor : quantized_tensors(2)) {
    const auto producer = std::ranges::find(layout, tensor.producer, &Convolution::name);
    ASSERT_NE(producer, layout.end()) << tensor.name;
    EXPECT_EQ(producer->out_channels, tensor.channels) << tensor.name;
    EXPECT_EQ(tensor.leaky, !tensor.name.starts_with("resblocks")) << tensor.name;
    EXPECT_TRUE(tensor.addend.empty() || names.contains(tensor.addend)) << tensor.name;
    EXPECT_TRUE(names.insert(tensor.name).second) << tensor.name;
  }
  EXPECT_EQ(names.size(), 12u);
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/decoding/source_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/dataset/wrapped_dataset.h"
#include "tests/testing/fake_dataset.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(FlowImage, HasStepsOfAPixelAroundTheMiddleOfItsNumbers) {
  const testing::TemporaryFolder folder;
  // Known: 0; 1 and -2 px of KITTI; both ends. Unknown: whatever stands there.
  const std::vector<std::uint16_t> rgb{32768, 32768, 1, 32832, 32640, 1,  //
                                       0,     65535, 1, 40000, 40000, 0};
  testing::write_file(folder / "flow.png", encode_wide_png({2, 2}, rgb));
  const SourceFlow kitti = read_flow_image(folder / "flow.png", "a.png", kKittiFlowSteps);
  EXPECT_EQ(kitti.size, (ImageSize{2, 2}));
  EXPECT_EQ(kitti.flow.px,
            (std::vector<float>{0, 1, -512, 0, 0, -2, static_cast<float>(32767 / 64.0), 0}));
  EXPECT_EQ(kitti.flow.valid, (std::vector<std::uint8_t>{1, 1, 1, 0}));
  EXPECT_EQ(read_flow_image(folder / "flow.png", "", kDsecFlowSteps).flow.px[1], 0.5);
}

TEST(FlowImage, IsAPngOf16Bits) {
  const testing::TemporaryFolder folder;
  const std::vector<std::uint8_t> grey(12);
  const std::string wide = encode_wide_png({2, 2}, std::vector<std::uint16_t>(12));
  const std::pair<std::string, const char*> faults[] = {
      {encode_png({{2, 2}, grey.data()}),
       "expected a whole PNG of 16 bits of red, green and blue, got fewer bits, in a.png"},
      {wide.substr(0, wide.size() - 20),
       "expected a whole PNG of 16 bits of red, green and blue, got "},
      {encode_index_png({2, 2}, std::vector<std::uint16_t>{0, 1000, 33000, 65535}),  // disparity
       "expected a whole PNG of 16 bits of red, green and blue, got another kind of pixels"},
      {encode_jpeg({{2, 2}, grey.data()}, 90), "expected a PNG, got a file of another kind"},
      {"", "expected a"}};
  for (const auto& [bytes, fault] : faults) {
    testing::write_file(folder / "flow.png", bytes);
    EXPECT_THROWS(read_flow_image(folder / "flow.png", "a.png", 64), std::runtime_error, fault);
  }
  EXPECT_THROWS(read_flow_image(folder / "none.png", "a.png", 64), std::runtime_error,
                "expected a readable file");
}

/// One labelled frame, and what is known of its pixels.
class WithFlow final : public WrappedDataset {
 public:
  WithFlow() : WrappedDataset(std::make_unique<testing::FakeDataset>("a", 1)) {}
  Outcome<SourceFlow> flow(const std::string&) const override { return flow_; }
  Outcome<SourceFlow> flow_ = SourceFlow();
};

class TrueFlowTest : public ::testing::Test {
 protected:
  /// Everywhere the same, known.
  void move(ImageSize size, float x, float y) {
    const std::size_t pixels = size.pixel_count();
    SourceFlow flow{"flow.png",
                    size,
                    {std::vector<float>(2 * pixels, y), std::vector<std::uint8_t>(pixels, 1)}};
    std::fill_n(flow.flow.px.begin(), pixels, x);
    dataset_.flow_ = std::move(flow);
  }
  PixelFlow in(const Placement& placement) const {
    const Outcome<PixelFlow> flow = true_flow(dataset_, "key", placement);
    EXPECT_FALSE(is_fault(flow));
    return is_fault(flow) ? PixelFlow() : *flow;
  }
  static Placement placed(ImageSize source, std::optional<ImageSize> volume, ImageFit fit) {
    ImageSpec spec;
    spec.size = volume;
    spec.fit = fit;
    return place(source, spec);
  }

  WithFlow dataset_;
};

TEST_F(TrueFlowTest, OfAnImageAsItIsStaysAndIsValidWhereItLeadsInside) {
  move({2, 4}, 1.5, 0);
  const PixelFlow flow = in(placed({2, 4}, std::nullopt, ImageFit::kStretch));
  EXPECT_EQ(flow.px, dataset_.flow_->flow.px);
  EXPECT_EQ(flow.valid, (std::vector<std::uint8_t>{1, 1, 0, 0, 1, 1, 0, 0}));  // 1 + 1.5 <= 3
}

TEST_F(TrueFlowTest, TheLeastStepOverTheEdgeIsOutside) {
  move({1, 2}, 1e-6f, 0);
  const PixelFlow flow = in(placed({1, 2}, std::nullopt, ImageFit::kStretch));
  EXPECT_EQ(flow.valid, (std::vector<std::uint8_t>{1, 0}));
}

TEST_F(TrueFlowTest, KnownMotionOfWhatIsHiddenStays) {
  move({1, 3}, 0, 0);
  dataset_.flow_->flow.valid = {1, 0, 1};
  dataset_.flow_->flow.px[1] = 1;
  const PixelFlow flow = in(placed({1, 3}, std::nullopt, ImageFit::kStretch));
  EXPECT_EQ(flow.px, (std::vector<float>{0, 1, 0, 0, 0, 0}));
  EXPECT_EQ(flow.valid, (std::vector<std::uint8_t>{1, 0, 1}));
}

TEST_F(TrueFlowTest, ScalesWithTheImageByTheNearestPixel) {
  // Half as wide and a third as high: pixel centres 0, 1 lie at 0.5, 2.5 and 1, 4 of the source.
  move({6, 4}, 8, 6);
  for (int i = 0; i < 24; ++i) dataset_.flow_->flow.px[static_cast<std::size_t>(i)] = float(i);
  const PixelFlow flow = in(placed({6, 4}, ImageSize{2, 2}, ImageFit::kStretch));
  // Rows 1 and 4; columns 0.5 and 2.5 are as near to the next one, which is taken.
  EXPECT_EQ(flow.px, (std::vector<float>{2.5, 3.5, 8.5, 9.5, 2, 2, 2, 2}));
  EXPECT_EQ(flow.valid, (std::vector<std::uint8_t>{0, 0, 0, 0}));
}

TEST_F(TrueFlowTest, LiesInTheShownPartOfALetterbox) {
  // 4 x 2 in 4 x 4: rows 1 and 2. One row down leads out of the image, though not of the volume.
  move({2, 4}, 0, 1);
  const PixelFlow flow = in(placed({2, 4}, ImageSize{4, 4}, ImageFit::kLetterbox));
  const std::vector<float> y(flow.px.begin() + 16, flow.px.end());
  EXPECT_EQ(y, (std::vector<float>{0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0}));
  EXPECT_EQ(flow.valid,
            (std::vector<std::uint8_t>{0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST_F(TrueFlowTest, IsCutAsTheImageIs) {
  move({2, 4}, 0, 0);
  for (int i = 0; i < 8; ++i) dataset_.flow_->flow.px[static_cast<std::size_t>(i)] = float(i);
  const PixelFlow flow = in(placed({2, 4}, ImageSize{2, 2}, ImageFit::kCrop));  // its middle
  EXPECT_EQ(flow.px, (std::vector<float>{1, 2, 5, 6, 0, 0, 0, 0}));
}

TEST_F(TrueFlowTest, IsAtMostWhatFloat16Holds) {
  move({1, 1}, 1e30f, -1e30f);
  EXPECT_EQ(in(placed({1, 1}, std::nullopt, ImageFit::kStretch)).px,
            (std::vector<float>{65504, -65504}));
}

TEST_F(TrueFlowTest, NoneIsNone) {
  EXPECT_TRUE(in(placed({1, 1}, std::nullopt, ImageFit::kStretch)).empty());
}

TEST_F(TrueFlowTest, OfAnotherSizeIsAFault) {
  move({4, 2}, 0, 0);
  const auto flow = true_flow(dataset_, "key", placed({2, 4}, std::nullopt, ImageFit::kStretch));
  ASSERT_TRUE(is_fault(flow));
  EXPECT_EQ(flow.fault().reason, "expected flow of 4x2, as the image is, got 2x4, in flow.png");
  dataset_.flow_ = SampleFault{"expected a whole PNG, got half of one"};
  const auto fault = true_flow(dataset_, "key", placed({4, 2}, std::nullopt, ImageFit::kStretch));
  ASSERT_TRUE(is_fault(fault));
  EXPECT_EQ(fault.fault().reason, "expected a whole PNG, got half of one");
}

}  // namespace
}  // namespace eventgan

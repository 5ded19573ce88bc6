#include "pipeline/simulation/clip_scene.h"

#include <gtest/gtest.h>

#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

class ClipSceneTest : public ::testing::Test {
 protected:
  ClipSceneTest() {
    testing::write_moving_clip(folder_ / "clip", {48, 64}, 3);
    manifest_ = testing::moving_clip_manifest(folder_.path(),
                                              R"({"path": "clip", "frames_per_second": 10})");
    clip_ = std::make_unique<ClipFrames>(manifest_.sources.at(0), manifest_);
  }

  testing::TemporaryFolder folder_;
  SimulationManifest manifest_;
  std::unique_ptr<ClipFrames> clip_;
};

TEST_F(ClipSceneTest, GoesThroughTheFrames) {
  ClipScene scene(*clip_, ClipMotion::kFade);
  EXPECT_FALSE(scene.has_flow());
  EXPECT_EQ(scene.frame(), clip_->frame(0));
  const auto first = scene.advance();
  EXPECT_EQ(scene.frame(), clip_->frame(1));
  EXPECT_DOUBLE_EQ(scene.time_s(), 0.1);
  EXPECT_EQ(first->steps(), 1);
  EXPECT_FLOAT_EQ(first->render(0).at(0) * 255, clip_->frame(0).pixels.at(0));
  EXPECT_NE(scene.advance(), nullptr);
  EXPECT_EQ(scene.advance(), nullptr);
  EXPECT_EQ(scene.frame(), clip_->frame(2));
}

TEST_F(ClipSceneTest, SeesTheSquareMove) {
  ClipScene scene(*clip_, ClipMotion::kFlow);
  EXPECT_TRUE(scene.has_flow());
  const auto interval = scene.advance();
  const FlowDisplacement flow = interval->flow();
  // The square covers x 4..27, y 12..35 and moves 2 px to the right.
  const std::size_t inside = 24 * 64 + 16, outside = 44 * 64 + 56;
  EXPECT_NEAR(flow.x_px.at(inside), 2, 0.5);
  EXPECT_NEAR(flow.y_px.at(inside), 0, 0.5);
  EXPECT_NEAR(flow.x_px.at(outside), 0, 0.5);
}

}  // namespace
}  // namespace eventgan

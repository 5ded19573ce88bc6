#include "pipeline/simulation/clip_scene.h"

#include <utility>

#include "stages/events/simulation/flow_interval.h"
#include "stages/events/simulation/linear_intensity.h"

namespace eventgan {
namespace {

/// Two frames and no picture between them: the sensor itself takes the log intensity to move on a
/// line from one picture to the next.
class FadeInterval final : public Interval {
 public:
  FadeInterval(GreyImage previous, GreyImage next)
      : previous_(std::move(previous)), next_(std::move(next)) {}
  ImageSize size() const override { return previous_.size; }
  int steps() const override { return 1; }
  std::vector<float> render(int step) const override {
    return linear_intensity(step == 0 ? previous_ : next_);
  }
  FlowDisplacement flow() const override { return {}; }

 private:
  GreyImage previous_;
  GreyImage next_;
};

}  // namespace

ClipScene::ClipScene(ClipFrames& clip, ClipMotion motion)
    : clip_(clip), motion_(motion), frame_(clip.frame(0)) {}

std::unique_ptr<Interval> ClipScene::advance() {
  if (position_ + 1 == clip_.count()) return nullptr;
  GreyImage previous = std::exchange(frame_, clip_.frame(position_ + 1));
  ++position_;
  if (motion_ == ClipMotion::kFade) {
    return std::make_unique<FadeInterval>(std::move(previous), frame_);
  }
  return std::make_unique<FlowInterval>(std::move(previous), frame_);
}

}  // namespace eventgan

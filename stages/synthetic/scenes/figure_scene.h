#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "manifests/values/labels.h"
#include "stages/synthetic/scenes/figure.h"
#include "stages/synthetic/scenes/image.h"

namespace eventgan {

/// A figure as it appears in the image.
struct FigureLabel {
  Joints3d joints3d;                          ///< mm, camera frame
  std::array<Point, kFigureJoints> joints{};  ///< their projections, px
  std::array<bool, kFigureJoints> visible{};  ///< no other limb lies in front
  Rectangle head_box;                         ///< around the head, edges in px
  Rectangle outline;                          ///< around all limbs, edges in px
};

/// Figures that walk and wave in front of a textured wall, seen by a camera that stands still.
/// Every image and label is a pure function of the constructor's arguments and the frame, which
/// may be any moment between two whole ones.
class FigureScene {
 public:
  FigureScene(std::uint64_t seed, const Intrinsics& camera, std::vector<FigureMotion> figures);

  static ImageSize size() { return {240, 320}; }
  const Intrinsics& camera() const { return camera_; }

  Image render(double frame) const;

  /// [y, x]: the index of the figure seen at each pixel's centre, -1 for the wall.
  std::vector<int> objects(double frame) const;

  /// One for each figure, in the order given.
  std::vector<FigureLabel> labels(double frame) const;

 private:
  /// What both of the above are made of.
  struct Drawing {
    std::vector<Colour> canvas;  ///< [y, x]
    std::vector<int> objects;
  };
  Drawing draw(double frame) const;
  std::vector<Limb3d> limbs_of(std::size_t figure, double frame) const;

  Texture texture_;
  Intrinsics camera_;
  std::vector<FigureMotion> figures_;
  std::vector<Colour> wall_;  ///< [y, x]
};

/// A figure whose place, heading and gait are drawn from the seed, such that it stays in the
/// image of `figure_camera` for the frames -10..20 and moves by 1 to 3 px a frame on average.
FigureMotion cast_figure(std::uint64_t seed, std::string_view role);

/// The same figure seen by a camera that stands elsewhere, turned by `angle` (rad) around the
/// vertical line through `pivot`.
FigureMotion seen_from(const FigureMotion& motion, const Vector3& pivot, double angle);

}  // namespace eventgan

#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "manifests/values/labels.h"
#include "manifests/values/still_motion.h"

namespace eventgan {

inline constexpr int kMostStillSide = 32766;  ///< OpenCV counts pixels in 16 bits

/// But for rounding.
bool is_identity(const AffineMap& map);

/// What is to move on its own in a photograph.
struct StillObject {
  std::size_t box;  ///< its number among the annotation's
  Outline outline;
  double lower_edge;  ///< of its box: the greater, the nearer it is
  double
      reach_px;  ///< how far it moves over the background at most; 0: not, but it may hide others
};

/// A photograph taken apart: a background, and before it the objects that do not move as it does,
/// farther ones first. What an object hides is filled as far as it can come to light: the
/// background from around the object, and a farther object that a nearer one hides from itself, as
/// mirrored at the object's edge.
class StillLayers {
 public:
  /// An object; what is outside `area` does not belong to it.
  struct Layer {
    std::size_t box;
    cv::Rect area;
    cv::Mat mask;    ///< [y, x] uint8 of `area`: not 0 where its outline is
    cv::Mat colour;  ///< of `area`
    cv::Mat cover;   ///< [y, x] uint8 of `area`: how much of what is behind it cannot be seen
    double reach_px;
  };

  /// `image`: [y, x] uint8 of one channel or three; shared, and left as it is. `behind_px`: how far
  /// a farther object may go on beyond its outline where nearer ones hide it. Throws
  /// std::invalid_argument of an image with a side beyond kMostStillSide.
  StillLayers(const cv::Mat& image, std::vector<StillObject> objects, double behind_px);

  /// The image as it is once the background and every object (by box; those of other boxes are not
  /// looked at) have moved; the maps lead from the frame that is wanted to the image. What moves is
  /// sampled bicubically (Keys with a = -0.75, places rounded to 1/32 px); places beyond the image
  /// take its nearest pixel, and so does an object that reaches the image's border. An object's
  /// edge is about a pixel soft. Thread safe.
  cv::Mat frame(const AffineMap& background, const std::vector<AffineMap>& objects) const;

  /// That frame without the objects that move, before a background that rests.
  cv::Mat resting_frame(const std::vector<AffineMap>& objects) const;

  const cv::Mat& background() const { return background_; }     ///< filled where objects move away
  const std::vector<Layer>& layers() const { return layers_; }  ///< farther ones first

  /// Where in the frame a layer can be seen.
  cv::Rect seen_in(const Layer& layer, const AffineMap& map) const;

  /// What each pixel of that frame shows: [y, x] uint16, 0 the background, else 1 + the box of the
  /// object that hides at least half of it. Empty if there is nothing but background.
  cv::Mat seen(const std::vector<AffineMap>& objects) const;

 private:
  /// Whether any of it can; `owner`: [y, x] uint16 of the image, 1 + the number of the layer in
  /// front.
  bool can_be_seen(std::size_t layer, const cv::Mat& owner) const;
  void fill_background(const cv::Mat& owner);
  void fill_layer(std::size_t layer, const cv::Mat& image, const cv::Mat& owner);
  void draw(const Layer& layer, const AffineMap& map, cv::Mat& frame) const;

  double behind_px_;
  cv::Mat background_;
  std::vector<Layer> layers_;
};

}  // namespace eventgan

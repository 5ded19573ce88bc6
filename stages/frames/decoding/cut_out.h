#pragma once

#include <vector>

#include "manifests/values/labels.h"
#include "manifests/values/outlines.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

/// Of a plan's fingerprint: another one wherever other pixels would be cut out.
inline constexpr const char* kCutOutMethod = "GrabCut, 48 px and a tenth around";

/// How objects are cut out; other values are for those who measure (cut_out_benchmark.cc).
struct CutOutSpec {
  int side_px = 48;    ///< of the box's longer side in the copy that is cut; smaller ones are kept
  int iterations = 1;  ///< of GrabCut
  /// Share of a square box's width that is sure to be the object; of another's in proportion to
  /// width / height, from 0.3 to 0.9.
  double core = 0.7;
};

/// What an object covers, found from its box alone.
struct CutOut {
  /// In pixels of the image, whole coordinates, within the box's part of the image; empty if the
  /// box holds no pixel's centre (it is outside, empty, or has an edge that is no number).
  Outline outline;
  /// GrabCut could not cut it, or did so badly: the outline is the ellipse in the box's part of the
  /// image.
  bool is_ellipse = false;
};

/// Cuts an object out of its image by GrabCut (Rother, Kolmogorov, Blake 2004) on a reduced copy of
/// the box and a tenth more around it. What is outside of the box is background, and an upright
/// ellipse in the box's middle is the object: it has 0.9 of the box's height, and the wider the box
/// the more of its width, since what stands is thin and what lies fills its box. Of what is cut the
/// part in the box's middle is kept, and its holes are closed.
///
/// An ellipse takes its place where a side has fewer than 16 pixels, where there is no background
/// (the box is the whole image), and where less than a tenth or more than 95 % of what lies in the
/// box beside the core was cut: of the labelled photographs that were measured
/// (manifests/guides/own_data.md) these are nearer to an ellipse.
///
/// A function of its arguments alone: OpenCV's random numbers, which are each thread's own, are
/// begun anew for each object. Throws std::bad_alloc, and std::runtime_error of what OpenCV
/// refuses. Thread safe.
CutOut cut_out(const ColourView& image, const Rectangle& box, const CutOutSpec& spec = {});

/// Gives the boxes that have no outline that of cut_out, but for regions to be ignored and boxes
/// beyond the image. Thread safe.
OutlineCounts cut_out_missing(const ColourView& image, std::vector<Box>& boxes);

}  // namespace eventgan

#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// A folder of images with KITTI's ground truth of optical flow (2012, 2015, their multi-view
/// extensions): of ROOT/NAME, in one of the left camera's folders image_2, image_0 or colored_0, it
/// is flow_occ/NAME.png beside ROOT, from this image to the one of the next number, valid where
/// flow_noc/NAME.png is, too; where there is but one of these folders, it tells both. Images
/// without are left out, unless the source has labels: their samples have no flow then. Notes name
/// those that another image follows, and maps of no labelled image. Of one map where there should
/// be two, or whose image another one follows, the sample is at fault.
///
/// Throws UsageError if ROOT is called otherwise, since the right camera's flow is another;
/// InputError if none of the images has flow.
std::unique_ptr<Dataset> with_flow(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                   const std::filesystem::path& base);

}  // namespace eventgan

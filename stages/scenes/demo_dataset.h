#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace eventgan {

/// The text of the manifest that converts the demo dataset beside it, with comments for a reader
/// who wants to write one of his own.
/// With `scenes` a fifth of KITTI's and MPII's is for validation.
std::string demo_manifest(std::uint64_t seed, int scenes = 0);

/// Writes a small synthetic dataset with exact labels into `folder`, in the layouts of KITTI object
/// (kitti/training/{image_2, prev_2, label_2, calib}), MPII (mpii/: both .mat files, images/ and
/// sequences/) and Human3.6M (h36m/, h36m-fetch layout), plus manifest.json that converts all
/// three: moving textured cars over a moving road; an articulated figure seen as MPII and as
/// Human3.6M. Every label is computed from the scene's geometry, not from pixels. `scenes` > 0: so
/// many streets and, if that is more than seven, so many figures, each of its own seed, to train
/// on. `between` > 0: beside each labelled frame so many moments between the frames, for
/// `eventgan simulate` (see the layouts' writers). The same arguments give the same bytes. Throws
/// std::runtime_error naming the path if something cannot be written; UsageError if `folder` exists
/// and is not empty.
void write_demo_dataset(const std::filesystem::path& folder, std::uint64_t seed, int scenes = 0,
                        int between = 0);

}  // namespace eventgan

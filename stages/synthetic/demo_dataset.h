#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace eventgan {

/// The text of the manifest that converts the demo dataset beside it, with comments for a reader
/// who wants to write another. With `sequences` about a fifth of KITTI's and MPII's is for
/// validation, of two at least one of each; a single street is to train on.
std::string demo_manifest(std::uint64_t seed, int sequences = 0);

/// Writes a small synthetic dataset with exact labels into `folder`, in the layouts of KITTI object
/// (kitti/training/{image_2, prev_2, label_2, calib}), MPII (mpii/: both .mat files, images/ and
/// sequences/) and Human3.6M (h36m/, h36m-fetch layout), plus manifest.json that converts all
/// three: moving textured cars over a moving road; an articulated figure seen as MPII and as
/// Human3.6M. Every label is computed from the scene's geometry, not from pixels. `sequences` > 0:
/// so many streets and, if that is more than seven, so many figures, each of its own seed, to train
/// on. `intermediate_count` > 0: beside each labelled frame so many intermediate frames, for
/// `eventgan simulate` (see the layouts' writers). The same arguments give the same bytes.
/// `on_image` is called demo_image_count(sequences) times as it goes. Throws std::runtime_error
/// naming the path if something cannot be written, and what `on_image` throws, and then leaves
/// nothing of it; UsageError if `folder` exists and is not empty.
void write_demo_dataset(
    const std::filesystem::path& folder, std::uint64_t seed, int sequences = 0,
    int intermediate_count = 0, const std::function<void()>& on_image = [] {});

/// The labelled images of KITTI and MPII that write_demo_dataset makes.
int demo_image_count(int sequences);

}  // namespace eventgan

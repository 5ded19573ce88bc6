#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "manifests/values/labels.h"
#include "stages/synthetic/scenes/road_scene.h"

namespace eventgan {

// The demo's and the tests' datasets, as the published ones are laid out.

/// The text of a label file: a line for each vehicle, 15 columns, numbers with two decimals.
std::string kitti_labels(const std::vector<RoadLabel>& labels);

/// The text of a calibration file: all four cameras are this one.
std::string kitti_calibration(const Intrinsics& camera);

/// The labelled frames that write_kitti_layout writes, by name: 12, or one of each scene.
std::vector<std::string> kitti_layout_names(int sequences);

/// Writes a drive (RoadScene) as KITTI's object set lays it out, 12 labelled frames with three
/// previous frames each: `root`/{image_2, prev_2, label_2, calib}; or, of `sequences` > 0, so many
/// drives with a labelled frame each, and then in between_2/NAME/ the intermediate frames
/// (write_intermediate_frames) from the frame before the labelled one to it. `on_frame` is called
/// after each labelled frame. Throws std::runtime_error naming the path.
void write_kitti_layout(
    const std::filesystem::path& root, std::uint64_t seed, int sequences = 0,
    int intermediate_count = 0, const std::function<void()>& on_frame = [] {});

/// The training images that write_mpii_layout writes, by name.
std::vector<std::string> mpii_layout_names(int sequences);

/// Writes figures (FigureScene) as MPII Human Pose lays them out: both .mat files, images/, and for
/// each image the 13 frames of video around it in sequences/NAME/. Six training images (or
/// `sequences` less one, if that is more) with full annotations, one of them with two people, and a
/// test image without joints. As in the original, coordinates count from 1, `is_visible` is a
/// number, a character or empty, and scale is the person's height / 200 px. In between/NAME/ are
/// the intermediate frames (write_intermediate_frames) from the frame before the labelled one to
/// that after it. `on_image` is called after each image. Throws std::runtime_error naming the path.
void write_mpii_layout(
    const std::filesystem::path& root, std::uint64_t seed, int sequences = 0,
    int intermediate_count = 0, const std::function<void()>& on_image = [] {});

/// Writes a walking figure (FigureScene), seen by two cameras, as the tool h36m-fetch lays out
/// Human3.6M: `root`/S1/Walking-1/{imageSequence/CAMERA/img_NNNNNN.jpg, annot.h5}, every fifth
/// frame, 12 a camera. pose/2d is the projection of pose/3d-univ (mm, the camera's frame) by
/// intrinsics/CAMERA [f_x, c_x, f_y, c_y]. Throws std::runtime_error naming the path.
void write_human36m_layout(const std::filesystem::path& root, std::uint64_t seed);

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace eventgan {

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

}  // namespace eventgan

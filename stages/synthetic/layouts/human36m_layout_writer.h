#pragma once

#include <cstdint>
#include <filesystem>

namespace eventgan {

/// Writes a walking figure (FigureScene), seen by two cameras, as the tool h36m-fetch lays out
/// Human3.6M: `root`/S1/Walking-1/{imageSequence/CAMERA/img_NNNNNN.jpg, annot.h5}, every fifth
/// frame, 12 a camera. pose/2d is the projection of pose/3d-univ (mm, the camera's frame) by
/// intrinsics/CAMERA [f_x, c_x, f_y, c_y]. Throws std::runtime_error naming the path.
void write_human36m_layout(const std::filesystem::path& root, std::uint64_t seed);

}  // namespace eventgan

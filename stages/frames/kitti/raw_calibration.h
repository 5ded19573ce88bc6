#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "manifests/image_size.h"
#include "manifests/labels.h"
#include "stages/frames/source_root.h"

namespace eventgan {

/// A point in metres.
using Point3 = std::array<double, 3>;

/// How the laser scanner's points come to lie in the rectified left colour picture, by KITTI raw's
///   x_rect = R_rect_00 (R x_velo + T),    (u, v, 1) ~ P_rect_02 (x_rect, 1).
/// The scanner's x points forward, y left, z up; the rectified camera's x right, y down, z forward.
struct RawCalibration {
  std::array<double, 9> rotation{};       ///< R, row-major
  Point3 translation{};                   ///< T, m
  std::array<double, 9> rectification{};  ///< R_rect_00, row-major
  std::array<double, 12> projection{};    ///< P_rect_02, row-major [3][4]
  ImageSize picture;                      ///< S_rect_02

  Point3 to_rectified(const Point3& velodyne) const;

  /// In pixels; `rectified` must lie before the camera.
  Point project(const Point3& rectified) const;
};

/// Reads DATE/calib_velo_to_cam.txt and DATE/calib_cam_to_cam.txt; nothing unless both are there.
/// Throws InputError if one lacks a key or has another number of values than it should.
std::optional<RawCalibration> read_raw_calibration(const SourceRoot& root, const std::string& date);

}  // namespace eventgan

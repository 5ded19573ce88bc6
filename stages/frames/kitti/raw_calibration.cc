#include "stages/frames/kitti/raw_calibration.h"

#include <cmath>
#include <limits>
#include <utility>

#include "manifests/faults.h"
#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

Point3 rotate(const std::array<double, 9>& m, const Point3& x) {
  return {m[0] * x[0] + m[1] * x[1] + m[2] * x[2], m[3] * x[0] + m[4] * x[1] + m[5] * x[2],
          m[6] * x[0] + m[7] * x[1] + m[8] * x[2]};
}

/// A calibration file: lines "KEY: number number ...".
class CalibrationFile {
 public:
  CalibrationFile(std::string text, std::string path)
      : text_(std::move(text)), path_(std::move(path)) {}

  template <std::size_t N>
  void read(std::string_view key, std::array<double, N>& values) const {
    for (const TextLine& line : split_lines(text_)) {
      const auto columns = split_columns(line.bytes);
      if (columns.empty() || columns[0] != std::string(key) + ":") continue;
      const std::string where = "in " + place_in_file(path_, line.number);
      if (columns.size() != N + 1) {
        throw InputError("expected " + std::to_string(N) + " numbers for " + std::string(key) +
                         ", got " + std::to_string(columns.size() - 1) + ", " + where);
      }
      for (std::size_t i = 0; i < N; ++i) {
        const auto number = parse_number<double>(columns[i + 1]);
        if (!number) {
          throw InputError("expected finite numbers for " + std::string(key) + ", got " +
                           in_quotes(columns[i + 1]) + ", " + where);
        }
        values[i] = *number;
      }
      return;
    }
    throw InputError("expected a line " + std::string(key) + ", got none, in " + path_);
  }

 private:
  std::string text_;
  std::string path_;
};

ImageSize to_size(const std::array<double, 2>& width_height, const std::string& path) {
  for (const double side : width_height) {
    if (side < 1 || side > std::numeric_limits<int>::max()) {
      throw InputError("expected a picture size for S_rect_02, got " + std::to_string(side) +
                       ", in " + path);
    }
  }
  return {static_cast<int>(std::lround(width_height[1])),
          static_cast<int>(std::lround(width_height[0]))};
}

}  // namespace

Point3 RawCalibration::to_rectified(const Point3& velodyne) const {
  Point3 camera = rotate(rotation, velodyne);
  for (std::size_t i = 0; i < 3; ++i) camera[i] += translation[i];
  return rotate(rectification, camera);
}

Point RawCalibration::project(const Point3& x) const {
  const auto row = [&](std::size_t i) {
    const double* p = projection.data() + 4 * i;
    return p[0] * x[0] + p[1] * x[1] + p[2] * x[2] + p[3];
  };
  return {row(0) / row(2), row(1) / row(2)};
}

std::optional<RawCalibration> read_raw_calibration(const SourceRoot& root,
                                                   const std::string& date) {
  const std::string velo_path = date + "/calib_velo_to_cam.txt";
  const std::string cam_path = date + "/calib_cam_to_cam.txt";
  if (!root.has_file(velo_path) || !root.has_file(cam_path)) return std::nullopt;

  RawCalibration calibration;
  const CalibrationFile velo(root.read_or_throw(velo_path), root.written(velo_path));
  velo.read("R", calibration.rotation);
  velo.read("T", calibration.translation);
  const CalibrationFile cam(root.read_or_throw(cam_path), root.written(cam_path));
  cam.read("R_rect_00", calibration.rectification);
  cam.read("P_rect_02", calibration.projection);
  std::array<double, 2> width_height{};
  cam.read("S_rect_02", width_height);
  calibration.picture = to_size(width_height, root.written(cam_path));
  return calibration;
}

}  // namespace eventgan

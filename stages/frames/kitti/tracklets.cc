#include "stages/frames/kitti/tracklets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <pugixml.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/kitti/detail/calibration_file.h"
#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/listing/numbered_sequence.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

/// Thrown by number(), caught at the borders of this file.
struct BadField : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <class Number>
Number number(const pugi::xml_node& parent, const char* name) {
  const std::string_view text = parent.child_value(name);
  if (const auto parsed = parse_number<Number>(text)) return *parsed;
  throw BadField(std::string("expected a ") + (std::is_integral_v<Number> ? "whole" : "finite") +
                 " number for " + name + ", got " + in_quotes(text));
}

double size(const pugi::xml_node& tracklet, const char* name) {
  const auto metres = number<double>(tracklet, name);
  if (metres > 0) return metres;
  throw BadField(std::string("expected a size above 0 for ") + name + ", got " +
                 in_quotes(tracklet.child_value(name)));
}

/// The writers' "unset" is -1 kept in eight bits.
int occlusion(const pugi::xml_node& pose) {
  constexpr int kUnset = 255;
  const int level = number<int>(pose, "occlusion");
  if (level == kUnset) return -1;
  if (level >= -1 && level <= 3) return level;
  throw BadField("expected a number from -1 to 3 for occlusion, got " + std::to_string(level));
}

/// boost writes beside the items how many there are.
void check_count(const pugi::xml_node& list, std::string_view what) {
  const auto count = number<std::int64_t>(list, "count");
  const auto items = list.children("item");
  const auto found = std::distance(items.begin(), items.end());
  if (count == found) return;
  throw BadField("expected " + std::to_string(count) + " " + std::string(what) +
                 " as <count> says, got " + std::to_string(found));
}

/// The field's text as the JSON value that holds it without loss of meaning.
Json json_value(std::string_view text) {
  if (const auto whole = parse_number<std::int64_t>(text)) return *whole;
  if (const auto real = parse_number<double>(text)) return *real;
  return std::string(text);
}

/// boost's bookkeeping, which is beside the data.
bool is_bookkeeping(std::string_view name) { return name == "count" || name == "item_version"; }

void add_fields(const pugi::xml_node& parent, Json& object) {
  for (const pugi::xml_node& field : parent.children()) {
    const std::string_view name = field.name();
    if (field.type() != pugi::node_element || name == "poses" || is_bookkeeping(name)) continue;
    object[std::string(name)] = json_value(field.child_value());
  }
}

TrackletPose read_pose(const pugi::xml_node& tracklet, const pugi::xml_node& pose) {
  TrackletPose read;
  const std::string_view type = tracklet.child_value("objectType");
  read.class_id = kitti_class_id(type);
  if (read.class_id < 0) throw BadField("expected one of KITTI's classes, got " + in_quotes(type));
  read.height = size(tracklet, "h");
  read.width = size(tracklet, "w");
  read.length = size(tracklet, "l");
  read.x = number<double>(pose, "tx");
  read.y = number<double>(pose, "ty");
  read.z = number<double>(pose, "tz");
  read.rotation_z = number<double>(pose, "rz");
  read.occlusion = occlusion(pose);
  read.truncation = number<int>(pose, "truncation");
  return read;
}

}  // namespace

struct Tracklets::Document {
  struct Entry {
    std::int64_t track;
    pugi::xml_node tracklet;
    pugi::xml_node pose;
  };

  pugi::xml_document xml;
  std::string path;
  std::map<std::int64_t, std::vector<Entry>> entries;  ///< by frame

  std::string where(std::int64_t track) const {
    return ", in " + path + " (tracklet " + std::to_string(track) + ")";
  }
};

Tracklets::Tracklets(const std::string& xml, std::string path)
    : document_(std::make_unique<Document>()) {
  document_->path = std::move(path);
  const auto result = document_->xml.load_buffer(xml.data(), xml.size());
  const pugi::xml_node tracklets = document_->xml.child("boost_serialization").child("tracklets");
  if (!result || !tracklets) {
    throw InputError("expected an XML file of tracklets, got '" +
                     std::string(result ? "another root" : result.description()) + "', in " +
                     document_->path);
  }
  try {
    check_count(tracklets, "tracklets");
  } catch (const BadField& error) {
    throw InputError(error.what() + (", in " + document_->path));
  }
  std::int64_t track = 0;
  for (const pugi::xml_node& tracklet : tracklets.children("item")) {
    try {
      auto frame = number<std::int64_t>(tracklet, "first_frame");
      if (frame < 0 || frame > kMaxFrameNumber) {
        throw BadField("expected a first_frame from 0 to " + std::to_string(kMaxFrameNumber) +
                       ", got " + std::to_string(frame));
      }
      check_count(tracklet.child("poses"), "poses");
      for (const pugi::xml_node& pose : tracklet.child("poses").children("item")) {
        document_->entries[frame++].push_back({track, tracklet, pose});
      }
    } catch (const BadField& error) {
      throw InputError(error.what() + document_->where(track));
    }
    ++track;
  }
}

Tracklets::~Tracklets() = default;
Tracklets::Tracklets(Tracklets&&) noexcept = default;

std::vector<std::int64_t> Tracklets::frames() const {
  std::vector<std::int64_t> frames;
  for (const auto& [frame, entries] : document_->entries) frames.push_back(frame);
  return frames;
}

Outcome<TrackletFrame> Tracklets::frame(std::int64_t frame_number) const {
  TrackletFrame frame;
  Json array = Json::array();
  const auto found = document_->entries.find(frame_number);
  if (found != document_->entries.end()) {
    for (const auto& [track, tracklet, pose] : found->second) {
      try {
        frame.poses.push_back(read_pose(tracklet, pose));
      } catch (const BadField& error) {
        return SampleFault{error.what() + document_->where(track)};
      }
      frame.poses.back().track = track;
      Json object{{"track", track}};
      add_fields(tracklet, object);
      object["pose"] = {{"frame", frame_number}};
      add_fields(pose, object["pose"]);
      array.push_back(std::move(object));
    }
  }
  // Bytes that are not UTF-8 must not stop a run: they become U+FFFD.
  frame.json = dump_json(array);
  return frame;
}

namespace {

Point3 rotate(const std::array<double, 9>& m, const Point3& x) {
  return {m[0] * x[0] + m[1] * x[1] + m[2] * x[2], m[3] * x[0] + m[4] * x[1] + m[5] * x[2],
          m[6] * x[0] + m[7] * x[1] + m[8] * x[2]};
}

ImageSize to_size(const std::array<double, 2>& width_height, const std::string& path) {
  for (const double side : width_height) {
    if (side < 1 || side > std::numeric_limits<int>::max()) {
      throw InputError("expected an image size for S_rect_02, got " + std::to_string(side) +
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
  const CalibrationFile velo(root, velo_path);
  calibration.rotation = velo.read<9>("R");
  calibration.translation = velo.read<3>("T");
  const CalibrationFile cam(root, cam_path);
  calibration.rectification = cam.read<9>("R_rect_00");
  calibration.projection = cam.read<12>("P_rect_02");
  calibration.image = to_size(cam.read<2>("S_rect_02"), root.written(cam_path));
  return calibration;
}

namespace {

/// What is nearer than this to the camera's plane is not seen; keeps the projection finite.
constexpr double kNearest_m = 0.1;

/// The cuboid's corners in the rectified frame. Corner i is at the far end of the length, width and
/// height where bit 0, 1 and 2 of i is set.
std::array<Point3, 8> corners(const TrackletPose& pose, const RawCalibration& calibration) {
  const double cosine = std::cos(pose.rotation_z);
  const double sine = std::sin(pose.rotation_z);
  std::array<Point3, 8> corners{};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const double along = pose.length * ((i & 1) ? 0.5 : -0.5);
    const double across = pose.width * ((i & 2) ? 0.5 : -0.5);
    const double up = (i & 4) ? pose.height : 0;
    corners[i] = calibration.to_rectified({pose.x + cosine * along - sine * across,
                                           pose.y + sine * along + cosine * across, pose.z + up});
  }
  return corners;
}

/// Grows around projected points.
struct Hull {
  Rectangle box{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                -std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

  void add(Point point) {
    box = {std::min(box.left, point.x), std::min(box.top, point.y), std::max(box.right, point.x),
           std::max(box.bottom, point.y)};
  }
};

/// The part of the edge from `a` to `b` before the camera, projected: leaving out corners behind
/// the camera alone would cut a near object short.
void add_edge(const Point3& a, const Point3& b, const RawCalibration& calibration, Hull& hull) {
  if (a[2] >= kNearest_m) hull.add(calibration.project(a));
  if (b[2] >= kNearest_m) hull.add(calibration.project(b));
  if ((a[2] >= kNearest_m) == (b[2] >= kNearest_m)) return;
  const double t = (kNearest_m - a[2]) / (b[2] - a[2]);
  hull.add(calibration.project({std::lerp(a[0], b[0], t), std::lerp(a[1], b[1], t), kNearest_m}));
}

/// To [-pi, pi].
double wrapped(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

/// The cuboid's outline cut to the image; nothing if it is not in the image.
std::optional<Rectangle> outline(const TrackletPose& pose, const RawCalibration& calibration) {
  const auto corner = corners(pose, calibration);
  Hull hull;
  for (std::size_t from = 0; from < corner.size(); ++from) {
    for (const std::size_t axis : {1u, 2u, 4u}) {
      if ((from & axis) == 0) add_edge(corner[from], corner[from | axis], calibration, hull);
    }
  }
  // Where KITTI's own labels end: a box that reaches beyond the image is 1241, 374 at the most of
  // 1242 x 375 pixels.
  const double right = calibration.image.width - 1;
  const double bottom = calibration.image.height - 1;
  if (!(hull.box.left < right && hull.box.right > 0 && hull.box.top < bottom &&
        hull.box.bottom > 0)) {
    return std::nullopt;
  }
  return Rectangle{std::clamp(hull.box.left, 0.0, right), std::clamp(hull.box.top, 0.0, bottom),
                   std::clamp(hull.box.right, 0.0, right),
                   std::clamp(hull.box.bottom, 0.0, bottom)};
}

}  // namespace

std::optional<Box> to_box(const TrackletPose& pose, const RawCalibration& calibration) {
  const auto seen = outline(pose, calibration);
  if (!seen) return std::nullopt;

  const Point3 place = calibration.to_rectified({pose.x, pose.y, pose.z});
  // With the axes as RawCalibration tells, the length's direction (cos rz, sin rz, 0) of the
  // scanner is
  // (-sin rz, 0, cos rz) of the camera; KITTI object writes that as (cos ry, 0, -sin ry).
  const double rotation_y = wrapped(-pose.rotation_z - std::numbers::pi / 2);

  Box box;
  box.class_id = pose.class_id;
  box.ignore = pose.class_id == kKittiDontCare;
  box.xyxy = *seen;
  box.truncation = pose.truncation == 0 ? 0.f : -1.f;
  box.occlusion = pose.occlusion;
  // The heading as the camera sees it: less the direction in which the object lies.
  box.alpha = static_cast<float>(wrapped(rotation_y - std::atan2(place[0], place[2])));
  const std::array<double, 7> box3d{pose.height, pose.width, pose.length, place[0],
                                    place[1],    place[2],   rotation_y};
  std::ranges::transform(box3d, box.box3d.begin(), [](double x) { return static_cast<float>(x); });
  box.track_id = pose.track;
  return box;
}

}  // namespace eventgan

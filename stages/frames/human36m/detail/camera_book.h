#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

/// One entry of cameras.pkl.
struct Human36mCamera {
  Intrinsics intrinsics;
  std::optional<LensDistortion> distortion;
  nlohmann::ordered_json fields;  ///< everything the entry says (R, T, c, f, k, p, w, h, name, id)
};

/// Cameras by subject and serial number: {"S1", "54138969"}.
using CameraBook = std::map<std::pair<std::string, std::string>, Human36mCamera>;

/// Reads cameras.pkl: a dictionary of (subject, serial number) to a dictionary with at least the
/// numpy arrays f and c of two elements, in pixels; k of three (k1, k2, k3) and p of two (p1, p2)
/// are the lens distortion, if they are there. Executes nothing of it. Throws InputError, also for
/// a camera that sees nothing: a focal length that is not above 0, numbers beyond 1e6 px or not
/// finite.
CameraBook read_camera_book(const std::filesystem::path& file);

/// That of a subject; null if the book has none.
const Human36mCamera* find_camera(const CameraBook& cameras, const std::string& subject,
                                  const std::string& camera);

/// What to tell of `without`, cameras of subjects ("S1 54138969") that the book does not have.
std::string no_intrinsics_note(const std::set<std::string>& without);

/// How far a camera may put a joint in 3-D from the joint in the image. A camera fitted without
/// lens distortion, as h36m-fetch does it, is up to 11 px off at Human3.6M's borders.
inline constexpr double kProjectionTolerance_px = 20;

/// The largest distance in px of a joint from where the person's camera projects its joint in 3-D;
/// infinity if one lies behind the camera, 0 without a camera.
double projection_error_px(const Person& person);

/// Takes the camera from a person whose joints in 3-D it does not project onto those in the
/// image, to within kProjectionTolerance_px: they do not belong together then, and which of them
/// is wrong cannot be told.
void take_wrong_camera(Person& person);

/// Of how many rows, with these errors, that takes the camera; `what` names the camera and the two
/// fields of joints. Empty if of none.
std::string wrong_camera_note(const std::vector<double>& errors_px, const std::string& what,
                              const std::string& file);

}  // namespace eventgan

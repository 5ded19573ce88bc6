#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "manifests/labels.h"

namespace eventgan {

/// One entry of cameras.pkl.
struct Human36mCamera {
  Intrinsics intrinsics;
  nlohmann::ordered_json fields;  ///< everything the entry says (R, T, c, f, k, p, w, h, name, id)
};

/// Cameras by subject and serial number: {"S1", "54138969"}.
using CameraBook = std::map<std::pair<std::string, std::string>, Human36mCamera>;

/// Reads cameras.pkl: a dictionary of (subject, serial number) to a dictionary with at least the
/// numpy arrays f and c of two elements, in pixels. Executes nothing of it. Throws InputError.
CameraBook read_camera_book(const std::filesystem::path& file);

}  // namespace eventgan

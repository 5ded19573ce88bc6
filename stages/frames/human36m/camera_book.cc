#include "stages/frames/human36m/detail/camera_book.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/archives/array_json.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/pickle.h"
#include "stages/frames/human36m/detail/pose_table.h"

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

[[noreturn]] void fail(const std::string& expected, const PickleNode& got,
                       const std::string& file) {
  throw InputError("expected " + expected + ", got " + describe(got.kind) + ", in " + file);
}

std::string text_of(const PickleNode& node, const std::string& file) {
  if (node.kind == Kind::kInt) return std::to_string(node.integer);
  if (node.kind != Kind::kString && node.kind != Kind::kBytes) fail("text", node, file);
  return node.text;
}

// Arrays, numbers and text; anything else has no place in a camera.
nlohmann::ordered_json json_of(const PickleNode& node, const std::string& file) {
  switch (node.kind) {
    case Kind::kNone:
      return nullptr;
    case Kind::kBool:
      return node.integer != 0;
    case Kind::kInt:
      return node.integer;
    case Kind::kFloat:
      return node.real;
    case Kind::kString:
    case Kind::kBytes:
      return node.text;
    default:
      return to_json(parse_pickled_array(node, file));
  }
}

std::vector<double> numbers(const PickleNode& camera, const char* name, std::size_t count,
                            const std::string& file) {
  const PickleNode* node = camera.find(name);
  const std::string where = file + " (" + name + ")";
  if (node == nullptr) throw InputError("expected a camera's values, got none, in " + where);
  const TypedArray array = parse_pickled_array(*node, where);
  if (array.size() != count || array.is_text()) {
    throw InputError("expected " + std::to_string(count) + " numbers, got " + array.shape_text() +
                     ", in " + where);
  }
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = array.number(i);
  return values;
}

std::optional<LensDistortion> distortion_of(const PickleNode& camera, const std::string& file) {
  if (camera.find("k") == nullptr && camera.find("p") == nullptr) return std::nullopt;
  const auto k = numbers(camera, "k", 3, file);
  const auto p = numbers(camera, "p", 2, file);
  const LensDistortion lens{k[0], k[1], k[2], p[0], p[1]};
  for (const double number : {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2}) {
    if (std::isfinite(number)) continue;
    throw InputError(
        fmt::format("expected a finite lens distortion, got {:g}, in {}", number, file));
  }
  return lens;
}

/// False of zeros and NaN.
bool sees(const Intrinsics& camera) {
  return camera.focal_x > 0 && camera.focal_x <= kFarthest_px && camera.focal_y > 0 &&
         camera.focal_y <= kFarthest_px && std::abs(camera.centre_x) <= kFarthest_px &&
         std::abs(camera.centre_y) <= kFarthest_px;
}

/// Where the camera sees a place before it, by the equations in manifests/values/labels.h.
Point project(const Intrinsics& camera, const LensDistortion& lens,
              const std::array<double, 3>& place) {
  const double a = place[0] / place[2];
  const double b = place[1] / place[2];
  const double r2 = a * a + b * b;
  const double d = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3)) + lens.p1 * b + lens.p2 * a;
  return {camera.focal_x * (a * d + lens.p2 * r2) + camera.centre_x,
          camera.focal_y * (b * d + lens.p1 * r2) + camera.centre_y};
}

std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  const std::string bytes = read_text_file(file);
  const auto view = std::as_bytes(std::span(bytes));
  return {view.begin(), view.end()};
}

}  // namespace

CameraBook read_camera_book(const std::filesystem::path& path) try {
  const std::string file = path.string();
  const PickleDocument document(read_bytes(path), numpy_globals(), file);
  const PickleNode& root = document.root();
  if (root.kind != Kind::kDict) fail("a dictionary of cameras", root, file);
  CameraBook book;
  for (std::size_t i = 0; i + 1 < root.items.size(); i += 2) {
    const PickleNode& key = *root.items[i];
    const PickleNode& camera = *root.items[i + 1];
    if (key.kind != Kind::kTuple || key.items.size() != 2) {
      fail("keys (subject, camera)", key, file);
    }
    if (camera.kind != Kind::kDict) fail("a dictionary for each camera", camera, file);
    const auto f = numbers(camera, "f", 2, file);
    const auto c = numbers(camera, "c", 2, file);
    Human36mCamera entry;
    entry.intrinsics = {f[0], f[1], c[0], c[1]};
    const std::string name = text_of(*key.items[0], file) + " " + text_of(*key.items[1], file);
    if (!sees(entry.intrinsics)) {
      throw InputError(fmt::format(
          "expected focal lengths above 0 and a centre within 1e6 px, got f [{:g} {:g}] and c "
          "[{:g} {:g}], in {} ({})",
          f[0], f[1], c[0], c[1], file, name));
    }
    entry.distortion = distortion_of(camera, file + " (" + name + ")");
    entry.fields = nlohmann::ordered_json::object();
    for (std::size_t k = 0; k + 1 < camera.items.size(); k += 2) {
      entry.fields[text_of(*camera.items[k], file)] = json_of(*camera.items[k + 1], file);
    }
    book[{text_of(*key.items[0], file), text_of(*key.items[1], file)}] = std::move(entry);
  }
  return book;
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {  // the pickle itself
  throw InputError(error.what());
}

const Human36mCamera* find_camera(const CameraBook& cameras, const std::string& subject,
                                  const std::string& camera) {
  const auto found = cameras.find({subject, camera});
  return found == cameras.end() ? nullptr : &found->second;
}

std::string no_intrinsics_note(const std::set<std::string>& without) {
  return "no intrinsics for " + std::to_string(without.size()) +
         " cameras of subjects, the first " + *without.begin() +
         ": not in a cameras.pkl in the root";
}

double projection_error_px(const Person& person) {
  double largest = 0;
  if (!person.camera) return largest;
  for (std::size_t j = 0; j < person.joints3d_mm.size(); ++j) {
    const auto& place = person.joints3d_mm[j];
    if (!place || person.joints[j].at == kMissingPoint) continue;
    if ((*place)[2] <= 0) return std::numeric_limits<double>::infinity();
    const Point at = project(*person.camera, person.distortion.value_or(LensDistortion{}), *place);
    largest =
        std::max(largest, std::hypot(at.x - person.joints[j].at.x, at.y - person.joints[j].at.y));
  }
  return largest;
}

void take_wrong_camera(Person& person) {
  if (projection_error_px(person) <= kProjectionTolerance_px) return;
  person.camera.reset();
  person.distortion.reset();
}

std::string wrong_camera_note(const std::vector<double>& errors_px, const std::string& what,
                              const std::string& file) {
  const auto wrong =
      std::ranges::count_if(errors_px, [](double e) { return e > kProjectionTolerance_px; });
  if (wrong == 0) return "";
  return fmt::format(
      "no camera for {} of {} rows: by {} a joint lies up to {:g} px from where it is annotated "
      "(expected at most {:g}), in {}",
      wrong, errors_px.size(), what, std::ranges::max(errors_px), kProjectionTolerance_px, file);
}

}  // namespace eventgan

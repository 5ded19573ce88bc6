#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <vector>

#include "manifests/faults.h"
#include "stages/archives/pickle/pickle.h"
#include "stages/archives/pickled_array.h"
#include "stages/archives/typed_array_json_internal.h"
#include "stages/frames/human36m/camera_book_internal.h"
#include "stages/frames/human36m/table_columns_internal.h"

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

std::pair<double, double> two_numbers(const PickleNode& camera, const char* name,
                                      const std::string& file) {
  const PickleNode* node = camera.find(name);
  const std::string where = file + " (" + name + ")";
  if (node == nullptr) throw InputError("expected a camera's values, got none, in " + where);
  const TypedArray array = parse_pickled_array(*node, where);
  if (array.size() != 2 || array.is_text()) {
    throw InputError("expected two numbers, got " + array.shape_text() + ", in " + where);
  }
  return {array.number(0), array.number(1)};
}

std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
  if (!stream) throw InputError("expected a readable file, got none, in " + file.string());
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
    const auto [focal_x, focal_y] = two_numbers(camera, "f", file);
    const auto [centre_x, centre_y] = two_numbers(camera, "c", file);
    Human36mCamera entry;
    entry.intrinsics = {focal_x, focal_y, centre_x, centre_y};
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

}  // namespace eventgan

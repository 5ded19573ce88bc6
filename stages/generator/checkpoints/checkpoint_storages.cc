#include "stages/generator/checkpoints/checkpoint_storages.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <stdexcept>

#include "stages/archives/pickled_array.h"
#include "stages/generator/checkpoints/checkpoint_archive.h"

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

static_assert(std::endian::native == std::endian::little, "storages are little endian");

template <class T>
T from_bytes(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

template <class T>
StoredNumber number() {
  return {sizeof(T),
          [](const std::byte* bytes) { return static_cast<float>(from_bytes<T>(bytes)); }};
}

/// IEEE 754 binary16: a sign, 5 bits of exponent, 10 of fraction. Not _Float16, which compilers
/// know on few processors.
float from_float16(const std::byte* bytes) {
  const unsigned bits = from_bytes<std::uint16_t>(bytes);
  const int exponent = bits >> 10 & 31;
  const int fraction = bits & 1023;
  float value = std::ldexp(static_cast<float>(exponent == 0 ? fraction : 1024 + fraction),
                           std::max(exponent, 1) - 25);
  if (exponent == 31) value = fraction == 0 ? INFINITY : NAN;
  return bits >> 15 ? -value : value;
}

/// bfloat16 is the upper half of a float32.
float from_bfloat16(const std::byte* bytes) {
  return std::bit_cast<float>(std::uint32_t{from_bytes<std::uint16_t>(bytes)} << 16);
}

const std::map<std::string, StoredNumber>& stored_numbers() {
  static const std::map<std::string, StoredNumber> kNumbers = {
      {"torch.FloatStorage", number<float>()},
      {"torch.DoubleStorage", number<double>()},
      {"torch.HalfStorage", {2, from_float16}},
      {"torch.BFloat16Storage", {2, from_bfloat16}},
      {"torch.LongStorage", number<std::int64_t>()},
      {"torch.IntStorage", number<std::int32_t>()},
      {"torch.ShortStorage", number<std::int16_t>()},
      {"torch.CharStorage", number<std::int8_t>()},
      {"torch.ByteStorage", number<std::uint8_t>()},
      {"torch.BoolStorage", number<std::uint8_t>()}};
  return kNumbers;
}

}  // namespace

const std::set<std::string>& checkpoint_globals() {
  static const std::set<std::string> kNames = [] {
    std::set<std::string> names = numpy_globals();
    names.insert({"collections.OrderedDict", "numpy._core.multiarray.scalar",
                  "numpy.core.multiarray.scalar", "torch._utils._rebuild_parameter",
                  "torch._utils._rebuild_tensor_v2"});
    for (const auto& [name, about] : stored_numbers()) names.insert(name);
    return names;
  }();
  return kNames;
}

const std::string& checkpoint_text(const PickleNode& node, std::size_t index, const char* what) {
  const bool is_bytes = index < node.items.size() && node.items[index]->kind == Kind::kBytes;
  return expect_item(node, index, is_bytes ? Kind::kBytes : Kind::kString, what).text;
}

StorageId parse_storage_id(const PickleNode& persistent) {
  const PickleNode& id = expect_item(persistent, 0, Kind::kTuple, "a storage's id");
  if (checkpoint_text(id, 0, "the word 'storage'") != "storage") {
    throw std::runtime_error("expected the id of a storage, got one of \"" +
                             printable(id.items[0]->text) + "\"");
  }
  const std::string& type = expect_item(id, 1, Kind::kGlobal, "a storage's type").text;
  const auto known = stored_numbers().find(type);
  if (known == stored_numbers().end()) {
    throw std::runtime_error("expected a storage of numbers, got " + type);
  }
  StorageId storage{known->second, checkpoint_text(id, 2, "a storage's key")};
  checkpoint_text(id, 3, "a storage's device");
  storage.count = expect_item(id, 4, Kind::kInt, "a storage's number of values").integer;
  storage.view_count = storage.count;
  if (id.items.size() > 5 && id.items[5]->kind != Kind::kNone) {
    const PickleNode& view = expect_item(id, 5, Kind::kTuple, "a part of a storage");
    storage.view_begin = expect_item(view, 1, Kind::kInt, "where a part begins").integer;
    storage.view_count = expect_item(view, 2, Kind::kInt, "a part's number of values").integer;
  }
  if (storage.count < 0 || storage.view_begin < 0 || storage.view_count < 0 ||
      storage.view_begin > storage.count ||
      storage.view_count > storage.count - storage.view_begin) {
    throw std::runtime_error("expected a part of a storage of " + std::to_string(storage.count) +
                             " values, got " + std::to_string(storage.view_count) +
                             " values from " + std::to_string(storage.view_begin) + " on");
  }
  return storage;
}

}  // namespace eventgan

#include "stages/generator/checkpoints/stored_tensor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <stdexcept>

#include "stages/base/archives/numpy_arrays.h"

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

namespace {

constexpr std::size_t kMostSides = 8;

[[noreturn]] void refuse_tensor(const std::string& expected, const std::string& got) {
  throw std::runtime_error("expected " + expected + ", got " + got);
}

const std::string& function_of(const PickleNode& call) {
  return expect_item(call, 0, Kind::kGlobal, "a function's name").text;
}

std::vector<std::int64_t> integers(const PickleNode& tuple, const char* what) {
  if (tuple.items.size() > kMostSides)
    refuse_tensor("at most 8 sides", std::to_string(tuple.items.size()));
  std::vector<std::int64_t> result;
  for (std::size_t i = 0; i < tuple.items.size(); ++i) {
    result.push_back(expect_item(tuple, i, Kind::kInt, what).integer);
  }
  return result;
}

/// Sets the count; every product and sum here stays below the part's number of values.
void check_inside_storage(StoredTensor& tensor) {
  const std::int64_t stored = tensor.storage.view_count;
  if (tensor.shape.size() != tensor.strides.size()) {
    refuse_tensor("as many strides as sides", "another number");
  }
  const auto refuse = [&](const std::string& got) {
    refuse_tensor("a tensor inside its storage of " + std::to_string(stored) + " values", got);
  };
  if (tensor.offset < 0 || tensor.offset >= stored)
    refuse("one from " + std::to_string(tensor.offset) + " on");
  tensor.count = 1;
  std::int64_t last = tensor.offset;
  for (std::size_t d = 0; d < tensor.shape.size(); ++d) {
    const std::int64_t side = tensor.shape[d];
    const std::int64_t stride = tensor.strides[d];
    // A side of 1 is never stepped along, so its stride may be anything.
    if (side < 1 || stride < (side > 1 ? 1 : 0) || side > stored / tensor.count ||
        (side > 1 && stride > (stored - 1 - last) / (side - 1))) {
      refuse("side " + std::to_string(side) + " with stride " + std::to_string(stride));
    }
    tensor.count *= side;
    last += (side - 1) * stride;
  }
}

}  // namespace

StoredTensor parse_stored_tensor(const PickleNode& node) {
  const PickleNode* call = &node;
  if (call->kind != Kind::kCall) refuse_tensor("a tensor", describe(call->kind));
  if (function_of(*call) == "torch._utils._rebuild_parameter") {
    const PickleNode& arguments = expect_item(*call, 1, Kind::kTuple, "a parameter's arguments");
    call = &expect_item(arguments, 0, Kind::kCall, "a parameter's tensor");
  }
  if (function_of(*call) != "torch._utils._rebuild_tensor_v2")
    refuse_tensor("a tensor", function_of(*call));
  const PickleNode& arguments = expect_item(*call, 1, Kind::kTuple, "a tensor's arguments");
  StoredTensor tensor;
  tensor.storage = parse_storage_id(expect_item(arguments, 0, Kind::kPersistent, "a storage"));
  tensor.offset = expect_item(arguments, 1, Kind::kInt, "a tensor's offset").integer;
  tensor.shape = integers(expect_item(arguments, 2, Kind::kTuple, "a tensor's shape"), "a side");
  tensor.strides =
      integers(expect_item(arguments, 3, Kind::kTuple, "a tensor's strides"), "a stride");
  check_inside_storage(tensor);
  return tensor;
}

NamedTensor gather(const StoredTensor& tensor, std::span<const std::byte> storage) {
  const StoredNumber& number = tensor.storage.number;
  if (storage.size() / number.size_bytes < static_cast<std::uint64_t>(tensor.storage.count)) {
    refuse_tensor("a storage of " + std::to_string(tensor.storage.count) + " values of " +
                      std::to_string(number.size_bytes) + " bytes",
                  std::to_string(storage.size()) + " bytes");
  }
  NamedTensor result{tensor.shape, {}};
  result.values.reserve(static_cast<std::size_t>(tensor.count));
  std::vector<std::int64_t> index(tensor.shape.size(), 0);
  std::int64_t at = tensor.storage.view_begin + tensor.offset;
  for (std::int64_t i = 0; i < tensor.count; ++i) {
    result.values.push_back(
        number.to_float(storage.data() + static_cast<std::size_t>(at) * number.size_bytes));
    // The next index in C order, the last side fastest.
    for (std::size_t d = index.size(); d-- > 0;) {
      at += tensor.strides[d];
      if (++index[d] < tensor.shape[d]) break;
      at -= tensor.strides[d] * tensor.shape[d];
      index[d] = 0;
    }
  }
  return result;
}

}  // namespace eventgan

#include "stages/generator/checkpoints/stored_tensor.h"

#include <stdexcept>

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

constexpr std::size_t kMostSides = 8;

[[noreturn]] void fail(const std::string& expected, const std::string& got) {
  throw std::runtime_error("expected " + expected + ", got " + got);
}

const std::string& function_of(const PickleNode& call) {
  return expect_item(call, 0, Kind::kGlobal, "a function's name").text;
}

std::vector<std::int64_t> integers(const PickleNode& tuple, const char* what) {
  if (tuple.items.size() > kMostSides) fail("at most 8 sides", std::to_string(tuple.items.size()));
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
    fail("as many strides as sides", "another number");
  }
  const auto refuse = [&](const std::string& got) {
    fail("a tensor inside its storage of " + std::to_string(stored) + " values", got);
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
  if (call->kind != Kind::kCall) fail("a tensor", describe(call->kind));
  if (function_of(*call) == "torch._utils._rebuild_parameter") {
    const PickleNode& arguments = expect_item(*call, 1, Kind::kTuple, "a parameter's arguments");
    call = &expect_item(arguments, 0, Kind::kCall, "a parameter's tensor");
  }
  if (function_of(*call) != "torch._utils._rebuild_tensor_v2") fail("a tensor", function_of(*call));
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
    fail("a storage of " + std::to_string(tensor.storage.count) + " values of " +
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

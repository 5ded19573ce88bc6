#include "stages/generator/checkpoint.h"

#include <bit>
#include <cstring>
#include <exception>
#include <map>
#include <stdexcept>

#include "manifests/faults.h"
#include "stages/archives/pickle/pickle.h"
#include "stages/archives/zip_archive.h"

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

/// What a checkpoint of tensors needs; anything else in a pickle is refused by name.
const std::set<std::string> kAllowedGlobals = {"collections.OrderedDict",
                                               "torch._utils._rebuild_tensor_v2",
                                               "torch._utils._rebuild_parameter",
                                               "torch.FloatStorage",
                                               "torch.DoubleStorage",
                                               "torch.HalfStorage",
                                               "torch.LongStorage",
                                               "torch.IntStorage",
                                               "torch.ShortStorage",
                                               "torch.CharStorage",
                                               "torch.ByteStorage",
                                               "torch.BoolStorage"};

template <class T>
float element(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<float>(value);
}

struct ElementType {
  std::size_t size_bytes;
  float (*to_float)(const std::byte*);
};

const std::map<std::string, ElementType> kElementTypes = {
    {"torch.FloatStorage", {4, element<float>}},
    {"torch.DoubleStorage", {8, element<double>}},
    {"torch.HalfStorage", {2, element<_Float16>}},
    {"torch.LongStorage", {8, element<std::int64_t>}},
    {"torch.IntStorage", {4, element<std::int32_t>}},
    {"torch.ShortStorage", {2, element<std::int16_t>}},
    {"torch.CharStorage", {1, element<std::int8_t>}},
    {"torch.ByteStorage", {1, element<std::uint8_t>}},
    {"torch.BoolStorage", {1, element<std::uint8_t>}}};

[[noreturn]] void fail(const std::string& expected, const std::string& got) {
  throw std::runtime_error("expected " + expected + ", got " + got);
}

const PickleNode& item(const PickleNode& node, std::size_t index, Kind kind, const char* what) {
  if (index >= node.items.size() || node.items[index]->kind != kind) fail(what, "something else");
  return *node.items[index];
}

std::vector<std::int64_t> integers(const PickleNode& tuple, const char* what) {
  std::vector<std::int64_t> result;
  for (std::size_t i = 0; i < tuple.items.size(); ++i) {
    result.push_back(item(tuple, i, Kind::kInt, what).integer);
  }
  return result;
}

/// Reads tensors of one archive; a storage that several tensors share is read once.
class TensorReader {
 public:
  TensorReader(const ZipArchive& archive, std::string prefix)
      : archive_(archive), prefix_(std::move(prefix)) {}

  /// `node` is _rebuild_tensor_v2(storage, offset, shape, stride, requires_grad, hooks), or a
  /// parameter around it.
  NamedTensor read(const PickleNode& node) {
    if (node.kind != Kind::kCall) fail("a tensor", "something else");
    const std::string& function = item(node, 0, Kind::kGlobal, "a function's name").text;
    const PickleNode& arguments = item(node, 1, Kind::kTuple, "a function's arguments");
    if (function == "torch._utils._rebuild_parameter") {
      return read(item(arguments, 0, Kind::kCall, "a parameter's tensor"));
    }
    if (function != "torch._utils._rebuild_tensor_v2") fail("a tensor", function);

    const PickleNode& id =
        item(item(arguments, 0, Kind::kPersistent, "a storage"), 0, Kind::kTuple, "a storage's id");
    const std::string& type = item(id, 1, Kind::kGlobal, "a storage's type").text;
    const std::string& key = item(id, 2, Kind::kString, "a storage's key").text;
    const auto known = kElementTypes.find(type);
    if (known == kElementTypes.end()) fail("a storage of numbers", type);
    return gather(storage(key), known->second,
                  item(arguments, 1, Kind::kInt, "a tensor's offset").integer,
                  integers(item(arguments, 2, Kind::kTuple, "a tensor's shape"), "a side"),
                  integers(item(arguments, 3, Kind::kTuple, "a tensor's strides"), "a stride"));
  }

 private:
  const std::vector<std::byte>& storage(const std::string& key) {
    auto found = storages_.find(key);
    if (found == storages_.end()) {
      found = storages_.emplace(key, archive_.read(prefix_ + "data/" + key)).first;
    }
    return found->second;
  }

  static NamedTensor gather(const std::vector<std::byte>& bytes, ElementType type,
                            std::int64_t offset, std::vector<std::int64_t> shape,
                            const std::vector<std::int64_t>& strides) {
    const auto stored = static_cast<std::int64_t>(bytes.size() / type.size_bytes);
    if (shape.size() != strides.size()) fail("as many strides as sides", "another number");
    std::int64_t count = 1;
    std::int64_t last = offset;
    for (std::size_t d = 0; d < shape.size(); ++d) {
      // A tensor never has more values than its storage (an expanded one, with stride 0, is not a
      // weight).
      if (shape[d] < 1 || strides[d] < 1 || strides[d] > stored || shape[d] > stored / count) {
        fail("a tensor inside its storage of " + std::to_string(stored) + " values",
             "side " + std::to_string(shape[d]) + " with stride " + std::to_string(strides[d]));
      }
      count *= shape[d];
      last += (shape[d] - 1) * strides[d];
    }
    if (offset < 0 || last >= stored)
      fail("a tensor inside its storage", "one that ends beyond it");

    NamedTensor tensor{std::move(shape), {}};
    tensor.values.reserve(static_cast<std::size_t>(count));
    std::vector<std::int64_t> index(tensor.shape.size(), 0);
    for (std::int64_t i = 0; i < count; ++i) {
      std::int64_t at = offset;
      for (std::size_t d = 0; d < index.size(); ++d) at += index[d] * strides[d];
      tensor.values.push_back(
          type.to_float(bytes.data() + at * static_cast<std::int64_t>(type.size_bytes)));
      for (std::size_t d = index.size(); d-- > 0 && ++index[d] == tensor.shape[d];) index[d] = 0;
    }
    return tensor;
  }

  const ZipArchive& archive_;
  std::string prefix_;
  std::map<std::string, std::vector<std::byte>> storages_;
};

/// Key and value nodes of a dict or an OrderedDict.
const std::vector<const PickleNode*>& entries(const PickleNode& node) {
  if (node.kind == Kind::kDict) return node.items;
  if (node.kind == Kind::kCall && !node.items.empty() &&
      node.items[0]->text == "collections.OrderedDict") {
    return node.assigned;
  }
  fail("a dict of tensors", "something else");
}

std::string key_list(const PickleNode& node) {
  std::string keys;
  const auto& all = entries(node);
  for (std::size_t i = 0; i + 1 < all.size(); i += 2)
    keys += (keys.empty() ? "" : ", ") + all[i]->text;
  return keys.empty() ? "none" : keys;
}

const PickleNode& choose_network(const PickleNode& root, const std::string& network) {
  if (const PickleNode* found = root.find(network)) return *found;
  if (root.find("head.conv2d.weight") != nullptr) return root;  // a bare state dict
  fail("key '" + network + "' (or a state dict itself)", "the keys " + key_list(root));
}

std::string find_prefix(const ZipArchive& archive) {
  for (const std::string& name : archive.names()) {
    if (name == "data.pkl" || name.ends_with("/data.pkl")) return name.substr(0, name.size() - 8);
  }
  fail("a PyTorch checkpoint with data.pkl inside", "another zip file");
}

}  // namespace

StateDict read_checkpoint(const std::filesystem::path& file, const std::string& network) try {
  const ZipArchive archive(file);
  const std::string prefix = find_prefix(archive);
  const std::vector<std::byte> pickle = archive.read(prefix + "data.pkl");
  const PickleDocument document(pickle, kAllowedGlobals, file.string() + ":" + prefix + "data.pkl");
  TensorReader reader(archive, prefix);
  StateDict state;
  const auto& all = entries(choose_network(document.root(), network));
  for (std::size_t i = 0; i + 1 < all.size(); i += 2) {
    if (all[i]->kind != Kind::kString) fail("text as a tensor's name", "something else");
    try {
      if (!all[i]->text.ends_with("num_batches_tracked"))
        state[all[i]->text] = reader.read(*all[i + 1]);
    } catch (const std::runtime_error&) {
      std::throw_with_nested(std::runtime_error("tensor " + all[i]->text));
    }
  }
  return state;
} catch (const std::runtime_error&) {
  std::throw_with_nested(
      InputError("cannot read a PyTorch checkpoint (zip format) from " + file.string()));
}

}  // namespace eventgan

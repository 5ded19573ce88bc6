#include "stages/generator/checkpoints/checkpoint.h"

#include <algorithm>
#include <exception>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string_view>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/generator/checkpoints/checkpoint_archive.h"
#include "stages/generator/checkpoints/stored_tensor.h"

namespace eventgan {
namespace {

using Kind = PickleNode::Kind;

/// Of a tensor beside its values: its names, shapes and places in maps.
constexpr std::uint64_t kBytesPerTensor = 1024;

[[noreturn]] void fail(const std::string& expected, const std::string& got) {
  throw std::runtime_error("expected " + expected + ", got " + got);
}

std::unique_ptr<CheckpointArchive> open_checkpoint(const std::filesystem::path& file) {
  const InputFile bytes(file);
  const std::string text = bytes.read(0, std::min<std::uint64_t>(bytes.size_bytes(), 512));
  if (text.starts_with("PK")) return open_zip_checkpoint(file);
  if (text.starts_with('\x80')) return open_legacy_checkpoint(file);
  const bool is_tar = text.size() > 262 && text.substr(257, 5) == "ustar";
  fail("a PyTorch checkpoint (a zip file or the format before PyTorch 1.6)",
       is_tar ? "a tar file, the format before PyTorch 0.1.10" : "another file");
}

bool is_ordered_dict(const PickleNode& node) {
  return node.kind == Kind::kCall &&
         expect_item(node, 0, Kind::kGlobal, "a function's name").text == "collections.OrderedDict";
}

/// Key and value nodes of a dict or an OrderedDict.
const std::vector<const PickleNode*>& entries(const PickleNode& node) {
  if (node.kind == Kind::kDict) return node.items;
  if (is_ordered_dict(node)) return node.assigned;
  fail("a dict of tensors", describe(node.kind));
}

bool is_text(const PickleNode& node) {
  return node.kind == Kind::kString || node.kind == Kind::kBytes;
}

std::string key_list(const PickleNode& node) {
  constexpr std::size_t kMost = 40;
  const auto& all = entries(node);
  std::string keys;
  for (std::size_t i = 0; i + 1 < all.size() && i / 2 < kMost; i += 2) {
    keys += keys.empty() ? "" : ", ";
    keys += is_text(*all[i]) ? printable(all[i]->text) : describe(all[i]->kind);
  }
  const std::size_t count = all.size() / 2;
  if (count > kMost) keys += " and " + std::to_string(count - kMost) + " others";
  return count == 0 ? "no keys" : "the keys " + keys;
}

/// The published code's networks and optimisers are known, and left out unless asked for; counters
/// are no dicts. Any other dict may be a part of the network that is asked for.
void refuse_unknown_parts(const PickleNode& root, const std::string& network) {
  static const std::set<std::string> networks = {"gen", "dis", "flow", "recons"};
  const auto& all = entries(root);
  for (std::size_t i = 0; i + 1 < all.size(); i += 2) {
    const std::string& key = all[i]->text;
    const PickleNode& value = *all[i + 1];
    const bool is_dict = value.kind == Kind::kDict || is_ordered_dict(value);
    if (!is_dict || key == network || networks.contains(key) || key.starts_with("optimizer")) {
      continue;
    }
    fail("gen, dis, flow, recons, optimizers and counters", "key '" + printable(key) + "'");
  }
}

const PickleNode& choose_network(const PickleNode& root, const std::string& network) {
  if (const PickleNode* found = root.find(network)) {
    refuse_unknown_parts(root, network);
    return *found;
  }
  for (const char* key : {"head.conv2d.weight", "head.weight"}) {
    if (root.find(key) != nullptr) return root;  // a bare state dict
  }
  fail("key '" + network + "' (or a generator's state dict itself)", key_list(root));
}

std::map<std::string, StoredTensor> stored_tensors(const PickleNode& state_dict,
                                                   CheckpointMemory& memory) {
  std::map<std::string, StoredTensor> tensors;
  const auto& all = entries(state_dict);
  for (std::size_t i = 0; i + 1 < all.size(); i += 2) {
    if (!is_text(*all[i])) fail("text as a tensor's name", describe(all[i]->kind));
    const std::string& name = all[i]->text;
    if (name.ends_with("num_batches_tracked")) continue;
    try {
      StoredTensor tensor = parse_stored_tensor(*all[i + 1]);
      memory.take(kBytesPerTensor + sizeof(float) * static_cast<std::uint64_t>(tensor.count));
      tensors.insert_or_assign(name, std::move(tensor));
    } catch (const std::runtime_error&) {
      std::throw_with_nested(std::runtime_error("tensor " + printable(name)));
    }
  }
  return tensors;
}

/// Reads each storage once, however many tensors share it, and holds one at a time.
StateDict convert(const CheckpointArchive& archive,
                  const std::map<std::string, StoredTensor>& tensors,
                  const CheckpointMemory& memory) {
  std::map<std::string, std::vector<const std::pair<const std::string, StoredTensor>*>> by_storage;
  for (const auto& named : tensors) by_storage[named.second.storage.key].push_back(&named);
  StateDict state;
  for (const auto& [key, users] : by_storage) {
    const std::vector<std::byte> storage = archive.storage(key, memory.left());
    for (const auto* named : users) {
      try {
        state.emplace(named->first, gather(named->second, storage));
      } catch (const std::runtime_error&) {
        std::throw_with_nested(std::runtime_error("tensor " + printable(named->first)));
      }
    }
  }
  return state;
}

}  // namespace

StateDict read_checkpoint(const std::filesystem::path& file, const std::string& network) try {
  const auto archive = open_checkpoint(file);
  const PickleDocument& document = archive->document();
  CheckpointMemory memory(most_checkpoint_memory(InputFile(file).size_bytes()));
  memory.take(document.memory_bytes());
  const auto tensors = stored_tensors(choose_network(document.root(), network), memory);
  return convert(*archive, tensors, memory);
} catch (const std::runtime_error&) {
  std::throw_with_nested(InputError("cannot read a PyTorch checkpoint from " + file.string()));
}

}  // namespace eventgan

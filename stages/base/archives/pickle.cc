#include "stages/base/archives/pickle.h"

#include <stdexcept>

#include "stages/base/archives/detail/pickle_machine.h"

namespace eventgan {

PickleDocument::PickleDocument(std::span<const std::byte> bytes,
                               const std::set<std::string>& allowed_globals,
                               const std::string& name, std::size_t* used,
                               std::uint64_t most_memory_bytes) {
  PickleMachine machine(PickleCursor(bytes, name), allowed_globals, nodes_, most_memory_bytes);
  root_ = machine.run();
  memory_bytes_ = machine.memory_bytes();
  if (used != nullptr) *used = machine.position();
}

const PickleNode* PickleNode::find(std::string_view key) const {
  const auto& pairs = kind == Kind::kCall ? assigned : items;
  if (kind != Kind::kDict && kind != Kind::kCall) return nullptr;
  for (std::size_t i = pairs.size() / 2; i-- > 0;) {
    const PickleNode& candidate = *pairs[2 * i];
    const bool is_text = candidate.kind == Kind::kString || candidate.kind == Kind::kBytes;
    if (is_text && candidate.text == key) return pairs[2 * i + 1];
  }
  return nullptr;
}

const PickleNode& expect_item(const PickleNode& node, std::size_t index, PickleNode::Kind kind,
                              const char* what) {
  const bool there = index < node.items.size();
  if (!there || node.items[index]->kind != kind) {
    throw std::runtime_error(std::string("expected ") + what + ", got " +
                             (there ? describe(node.items[index]->kind) : "nothing"));
  }
  return *node.items[index];
}

std::string printable(std::string_view text) {
  constexpr std::size_t kLongest = 80;
  std::string result;
  for (const char c : text.substr(0, kLongest)) result += c >= ' ' && c <= '~' ? c : '?';
  if (text.size() > kLongest) result += "...";
  return result;
}

const char* describe(PickleNode::Kind kind) {
  switch (kind) {
    case PickleNode::Kind::kNone:
      return "None";
    case PickleNode::Kind::kBool:
      return "a bool";
    case PickleNode::Kind::kInt:
    case PickleNode::Kind::kLong:
      return "an integer";
    case PickleNode::Kind::kFloat:
      return "a float";
    case PickleNode::Kind::kString:
      return "a string";
    case PickleNode::Kind::kBytes:
      return "bytes";
    case PickleNode::Kind::kList:
      return "a list";
    case PickleNode::Kind::kTuple:
      return "a tuple";
    case PickleNode::Kind::kDict:
      return "a dictionary";
    case PickleNode::Kind::kGlobal:
      return "a global";
    case PickleNode::Kind::kCall:
      return "an object";
    case PickleNode::Kind::kPersistent:
      return "a persistent id";
  }
  return "nothing";
}

}  // namespace eventgan

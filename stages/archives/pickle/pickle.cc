#include "stages/archives/pickle/pickle.h"

#include "stages/archives/pickle/pickle_machine_internal.h"

namespace eventgan {

PickleDocument::PickleDocument(std::span<const std::byte> bytes,
                               const std::set<std::string>& allowed_globals,
                               const std::string& name, std::size_t* used) {
  PickleMachine machine(PickleCursor(bytes, name), allowed_globals, nodes_);
  root_ = machine.run();
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

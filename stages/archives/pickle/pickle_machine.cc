#include <utility>

#include "stages/archives/pickle/pickle_machine_internal.h"

namespace eventgan {

// The memory, the stack, its marks and the memo.

void PickleMachine::count_memory(std::uint64_t bytes) {
  if (bytes > most_memory_bytes_ - memory_bytes_) {
    cursor_.fail("values of at most " + std::to_string(most_memory_bytes_) + " bytes of memory",
                 "more");
  }
  memory_bytes_ += bytes;
}

PickleNode& PickleMachine::push(Kind kind) {
  PickleNode& node = nodes_.emplace_back();
  node.kind = kind;
  stack_.push_back(&node);
  return node;
}

PickleNode* PickleMachine::top() {
  const std::size_t floor = marks_.empty() ? 0 : marks_.back();
  if (stack_.size() <= floor) {
    cursor_.fail("a value on the stack", marks_.empty() ? "an empty stack" : "a mark");
  }
  return stack_.back();
}

PickleNode* PickleMachine::pop() {
  PickleNode* node = top();
  stack_.pop_back();
  return node;
}

std::vector<const PickleNode*> PickleMachine::pop_to_mark() {
  if (marks_.empty()) cursor_.fail("a mark on the stack", "none");
  const auto from = stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back());
  std::vector<const PickleNode*> values(from, stack_.end());
  stack_.erase(from, stack_.end());
  marks_.pop_back();
  return values;
}

std::vector<const PickleNode*> PickleMachine::pop_count(std::size_t count) {
  std::vector<const PickleNode*> values(count);
  for (std::size_t i = count; i-- > 0;) values[i] = pop();
  return values;
}

void PickleMachine::recall(std::uint64_t key) {
  const auto found = memo_.find(key);
  if (found == memo_.end()) {
    cursor_.fail("a value in the memo", "none under " + std::to_string(key));
  }
  stack_.push_back(found->second);
}

// What an opcode does to a value that is already there.

void PickleMachine::append(const std::vector<const PickleNode*>& values) {
  PickleNode* list = top();
  if (list->kind != Kind::kList) cursor_.fail("a list to append to", describe(list->kind));
  list->items.insert(list->items.end(), values.begin(), values.end());
}

void PickleMachine::set_items(const std::vector<const PickleNode*>& pairs) {
  PickleNode* target = top();
  if (target->kind != Kind::kDict && target->kind != Kind::kCall) {
    cursor_.fail("a dictionary to set items on", describe(target->kind));
  }
  if (pairs.size() % 2 != 0) cursor_.fail("keys with values", "a key without a value");
  auto& items = target->kind == Kind::kDict ? target->items : target->assigned;
  items.insert(items.end(), pairs.begin(), pairs.end());
}

void PickleMachine::build() {
  const PickleNode* state = pop();
  PickleNode* target = top();
  if (target->kind != Kind::kCall) {
    cursor_.fail("an object to give a state", describe(target->kind));
  }
  if (target->state != nullptr) cursor_.fail("an object without a state", "a second state for it");
  target->state = state;
}

void PickleMachine::push_global(const std::string& module, const std::string& name) {
  const std::string global = module + "." + name;
  if (!allowed_globals_.contains(global)) {
    std::string allowed;
    for (const std::string& one : allowed_globals_) allowed += (allowed.empty() ? "" : ", ") + one;
    cursor_.fail(allowed.empty() ? "no global" : "a global out of {" + allowed + "}",
                 "\"" + printable(global) + "\"");
  }
  push(Kind::kGlobal).text = global;
}

void PickleMachine::push_call() {
  const PickleNode* arguments = pop();
  const PickleNode* callable = pop();
  if (callable->kind != Kind::kGlobal || arguments->kind != Kind::kTuple) {
    cursor_.fail("a global and a tuple of arguments",
                 std::string(describe(callable->kind)) + " and " + describe(arguments->kind));
  }
  push(Kind::kCall).items = {callable, arguments};
}

}  // namespace eventgan

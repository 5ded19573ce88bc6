#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "stages/archives/pickle/pickle.h"
#include "stages/archives/pickle/pickle_cursor_internal.h"
#include "stages/archives/pickle/pickle_opcodes_internal.h"

namespace eventgan {

/// Python's pickle machine with nothing but data in it: a stack of nodes, the marks set on it, and
/// the memo. A program for it is a flat list of opcodes, so nothing here recurses.
class PickleMachine {
 public:
  PickleMachine(PickleCursor cursor, const std::set<std::string>& allowed_globals,
                std::deque<PickleNode>& nodes,
                std::uint64_t most_memory_bytes = std::numeric_limits<std::uint64_t>::max())
      : cursor_(std::move(cursor)),
        allowed_globals_(allowed_globals),
        nodes_(nodes),
        most_memory_bytes_(most_memory_bytes) {}

  /// Runs until STOP and gives what is left on the stack then.
  const PickleNode* run();

  std::size_t position() const { return cursor_.position(); }
  std::uint64_t memory_bytes() const { return memory_bytes_; }

 private:
  using Kind = PickleNode::Kind;

  void step(PickleOpcode opcode);
  bool push_scalar(PickleOpcode opcode);
  bool push_text(PickleOpcode opcode);
  bool push_container(PickleOpcode opcode);
  bool change_container(PickleOpcode opcode);
  bool use_memo(PickleOpcode opcode);

  /// Counts memory before it is taken; refuses what would be too much.
  void count_memory(std::uint64_t bytes);

  PickleNode& push(Kind kind);
  void push_integer(Kind kind, std::int64_t value);
  void push_long(std::string_view bytes);
  void push_text(Kind kind, std::string_view text);
  void push_items(Kind kind, std::vector<const PickleNode*> items);
  void push_global(const std::string& module, const std::string& name);
  void push_call();

  PickleNode* top();
  PickleNode* pop();
  /// What was pushed since the last mark; takes it and the mark off.
  std::vector<const PickleNode*> pop_to_mark();
  std::vector<const PickleNode*> pop_count(std::size_t count);

  void append(const std::vector<const PickleNode*>& values);
  void set_items(const std::vector<const PickleNode*>& pairs);
  void build();

  void remember(std::uint64_t key) { memo_[key] = top(); }
  void recall(std::uint64_t key);
  std::uint64_t memo_key_of_line();

  PickleCursor cursor_;
  const std::set<std::string>& allowed_globals_;
  std::deque<PickleNode>& nodes_;
  std::uint64_t most_memory_bytes_;
  std::uint64_t memory_bytes_ = 0;
  std::vector<PickleNode*> stack_;
  std::vector<std::size_t> marks_;  // sizes of the stack when MARK came
  std::unordered_map<std::uint64_t, PickleNode*> memo_;
};

}  // namespace eventgan

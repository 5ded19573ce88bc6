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

#include "stages/base/archives/detail/pickle_cursor.h"
#include "stages/base/archives/pickle.h"

namespace eventgan {

/// The opcodes of Python's pickle machine that this project reads; names as in Python's
/// pickletools.
enum class PickleOpcode : std::uint8_t {
  kMark = '(',
  kStop = '.',
  kPop = '0',
  kPopMark = '1',
  kDup = '2',
  kBinBytes = 'B',
  kShortBinBytes = 'C',
  kFloat = 'F',
  kBinFloat = 'G',
  kInt = 'I',
  kBinInt = 'J',
  kBinInt1 = 'K',
  kLong = 'L',
  kBinInt2 = 'M',
  kNone = 'N',
  kBinPersId = 'Q',
  kReduce = 'R',
  kString = 'S',
  kBinString = 'T',
  kShortBinString = 'U',
  kUnicode = 'V',
  kBinUnicode = 'X',
  kEmptyList = ']',
  kAppend = 'a',
  kBuild = 'b',
  kGlobal = 'c',
  kDict = 'd',
  kAppends = 'e',
  kGet = 'g',
  kBinGet = 'h',
  kLongBinGet = 'j',
  kList = 'l',
  kPut = 'p',
  kBinPut = 'q',
  kLongBinPut = 'r',
  kSetItem = 's',
  kTuple = 't',
  kSetItems = 'u',
  kEmptyDict = '}',
  kEmptyTuple = ')',
  kProto = 0x80,
  kNewObj = 0x81,
  kTuple1 = 0x85,
  kTuple2 = 0x86,
  kTuple3 = 0x87,
  kNewTrue = 0x88,
  kNewFalse = 0x89,
  kLong1 = 0x8a,
  kLong4 = 0x8b,
  kShortBinUnicode = 0x8c,
  kBinUnicode8 = 0x8d,
  kBinBytes8 = 0x8e,
  kStackGlobal = 0x93,
  kMemoize = 0x94,
  kFrame = 0x95,
};

/// The name of an opcode that exists in Python but not above ("EXT1"); nullptr if Python has none.
const char* refused_opcode_name(std::uint8_t code);

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

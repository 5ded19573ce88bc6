#include "stages/base/archives/detail/pickle_machine.h"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <utility>

#include "stages/base/archives/detail/pickle_cursor.h"

// What each opcode does, in groups; a group says false to an opcode that is not its own.

namespace eventgan {

const char* refused_opcode_name(std::uint8_t code) {
  switch (code) {
    case 'P':
      return "PERSID";
    case 'i':
      return "INST";
    case 'o':
      return "OBJ";
    case 0x82:
      return "EXT1";
    case 0x83:
      return "EXT2";
    case 0x84:
      return "EXT4";
    case 0x8f:
      return "EMPTY_SET";
    case 0x90:
      return "ADDITEMS";
    case 0x91:
      return "FROZENSET";
    case 0x92:
      return "NEWOBJ_EX";
    case 0x96:
      return "BYTEARRAY8";
    case 0x97:
      return "NEXT_BUFFER";
    case 0x98:
      return "READONLY_BUFFER";
    default:
      return nullptr;
  }
}

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
    cursor_.fail(allowed_globals_.empty()
                     ? "no global"
                     : fmt::format("a global out of {{{}}}", fmt::join(allowed_globals_, ", ")),
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

const PickleNode* PickleMachine::run() {
  // What one opcode makes at most beside text: a node, its place on the stack, in the memo and in a
  // container, with what containers hold in reserve.
  constexpr std::uint64_t kBytesPerOpcode = sizeof(PickleNode) + 80;
  for (;;) {
    const auto opcode = static_cast<PickleOpcode>(cursor_.opcode());
    if (opcode == PickleOpcode::kStop) break;
    count_memory(kBytesPerOpcode);
    step(opcode);
  }
  const PickleNode* root = pop();
  if (!stack_.empty() || !marks_.empty()) {
    cursor_.fail("one value on the stack at STOP", std::to_string(stack_.size() + 1));
  }
  return root;
}

void PickleMachine::step(PickleOpcode opcode) {
  if (push_scalar(opcode) || push_text(opcode) || push_container(opcode) ||
      change_container(opcode) || use_memo(opcode)) {
    return;
  }
  const auto code = static_cast<std::uint8_t>(opcode);
  const char* name = refused_opcode_name(code);
  cursor_.fail("an opcode that data needs",
               name != nullptr ? name : "unknown opcode " + std::to_string(code));
}

bool PickleMachine::push_scalar(PickleOpcode opcode) {
  switch (opcode) {
    case PickleOpcode::kNone:
      push(Kind::kNone);
      return true;
    case PickleOpcode::kNewTrue:
    case PickleOpcode::kNewFalse:
      push_integer(Kind::kBool, opcode == PickleOpcode::kNewTrue ? 1 : 0);
      return true;
    case PickleOpcode::kBinInt:
      push_integer(Kind::kInt, static_cast<std::int32_t>(cursor_.little_endian(4)));
      return true;
    case PickleOpcode::kBinInt1:
      push_integer(Kind::kInt, static_cast<std::int64_t>(cursor_.little_endian(1)));
      return true;
    case PickleOpcode::kBinInt2:
      push_integer(Kind::kInt, static_cast<std::int64_t>(cursor_.little_endian(2)));
      return true;
    case PickleOpcode::kLong1:
      push_long(cursor_.counted(1));
      return true;
    case PickleOpcode::kLong4:
      push_long(cursor_.counted(4));
      return true;
    case PickleOpcode::kInt:
    case PickleOpcode::kLong: {
      const std::string_view line = cursor_.line();
      // Protocol 0 and 1 write True and False as integers with a leading zero.
      const bool is_bool = opcode == PickleOpcode::kInt && (line == "00" || line == "01");
      const auto value = parse_pickle_integer(line);
      if (!value) cursor_.fail("a decimal integer of 64 bits", "\"" + printable(line) + "\"");
      push_integer(is_bool ? Kind::kBool : Kind::kInt, *value);
      return true;
    }
    case PickleOpcode::kFloat: {
      const std::string_view line = cursor_.line();
      const auto value = parse_pickle_float(line);
      if (!value) cursor_.fail("a decimal number", "\"" + printable(line) + "\"");
      push(Kind::kFloat).real = *value;
      return true;
    }
    case PickleOpcode::kBinFloat: {
      const double value = cursor_.big_endian_double();
      push(Kind::kFloat).real = value;
      return true;
    }
    default:
      return false;
  }
}

bool PickleMachine::push_text(PickleOpcode opcode) {
  switch (opcode) {
    case PickleOpcode::kBinUnicode:
      push_text(Kind::kString, cursor_.counted(4));
      return true;
    case PickleOpcode::kShortBinUnicode:
      push_text(Kind::kString, cursor_.counted(1));
      return true;
    case PickleOpcode::kBinUnicode8:
      push_text(Kind::kString, cursor_.counted(8));
      return true;
    case PickleOpcode::kBinBytes:
    case PickleOpcode::kBinString:
      push_text(Kind::kBytes, cursor_.counted(4));
      return true;
    case PickleOpcode::kShortBinBytes:
    case PickleOpcode::kShortBinString:
      push_text(Kind::kBytes, cursor_.counted(1));
      return true;
    case PickleOpcode::kBinBytes8:
      push_text(Kind::kBytes, cursor_.counted(8));
      return true;
    case PickleOpcode::kString:
    case PickleOpcode::kUnicode: {
      const bool bytes = opcode == PickleOpcode::kString;
      const std::string_view line = cursor_.line();
      const auto text = bytes ? parse_pickle_string(line) : parse_pickle_unicode(line);
      if (!text) cursor_.fail("a string of Python source text", "\"" + printable(line) + "\"");
      push_text(bytes ? Kind::kBytes : Kind::kString, *text);
      return true;
    }
    case PickleOpcode::kGlobal: {
      const std::string module(cursor_.line());
      push_global(module, std::string(cursor_.line()));
      return true;
    }
    case PickleOpcode::kStackGlobal: {
      const PickleNode* name = pop();
      const PickleNode* module = pop();
      if (name->kind != Kind::kString || module->kind != Kind::kString) {
        cursor_.fail("the strings module and name",
                     std::string(describe(module->kind)) + " and " + describe(name->kind));
      }
      push_global(module->text, name->text);
      return true;
    }
    default:
      return false;
  }
}

bool PickleMachine::push_container(PickleOpcode opcode) {
  switch (opcode) {
    case PickleOpcode::kEmptyTuple:
      push(Kind::kTuple);
      return true;
    case PickleOpcode::kTuple1:
    case PickleOpcode::kTuple2:
    case PickleOpcode::kTuple3:
      push_items(Kind::kTuple, pop_count(static_cast<std::size_t>(opcode) -
                                         static_cast<std::size_t>(PickleOpcode::kTuple1) + 1));
      return true;
    case PickleOpcode::kTuple:
      push_items(Kind::kTuple, pop_to_mark());
      return true;
    case PickleOpcode::kEmptyList:
      push(Kind::kList);
      return true;
    case PickleOpcode::kList:
      push_items(Kind::kList, pop_to_mark());
      return true;
    case PickleOpcode::kEmptyDict:
      push(Kind::kDict);
      return true;
    case PickleOpcode::kDict: {
      const auto pairs = pop_to_mark();
      push(Kind::kDict);
      set_items(pairs);
      return true;
    }
    case PickleOpcode::kReduce:
    case PickleOpcode::kNewObj:
      push_call();
      return true;
    case PickleOpcode::kBinPersId:
      push_items(Kind::kPersistent, pop_count(1));
      return true;
    default:
      return false;
  }
}

bool PickleMachine::change_container(PickleOpcode opcode) {
  switch (opcode) {
    case PickleOpcode::kAppend:
      append(pop_count(1));
      return true;
    case PickleOpcode::kAppends:
      append(pop_to_mark());
      return true;
    case PickleOpcode::kSetItem:
      set_items(pop_count(2));
      return true;
    case PickleOpcode::kSetItems:
      set_items(pop_to_mark());
      return true;
    case PickleOpcode::kBuild:
      build();
      return true;
    default:
      return false;
  }
}

bool PickleMachine::use_memo(PickleOpcode opcode) {
  switch (opcode) {
    case PickleOpcode::kPut:
      remember(memo_key_of_line());
      return true;
    case PickleOpcode::kBinPut:
      remember(cursor_.little_endian(1));
      return true;
    case PickleOpcode::kLongBinPut:
      remember(cursor_.little_endian(4));
      return true;
    case PickleOpcode::kMemoize:
      remember(memo_.size());
      return true;
    case PickleOpcode::kGet:
      recall(memo_key_of_line());
      return true;
    case PickleOpcode::kBinGet:
      recall(cursor_.little_endian(1));
      return true;
    case PickleOpcode::kLongBinGet:
      recall(cursor_.little_endian(4));
      return true;
    case PickleOpcode::kMark:
      marks_.push_back(stack_.size());
      return true;
    case PickleOpcode::kPop:
      // As in Python, POP takes off whichever came last, a value or a mark.
      if (!marks_.empty() && marks_.back() == stack_.size()) {
        marks_.pop_back();
      } else {
        pop();
      }
      return true;
    case PickleOpcode::kPopMark:
      pop_to_mark();
      return true;
    case PickleOpcode::kDup:
      stack_.push_back(top());
      return true;
    case PickleOpcode::kProto: {
      const std::uint64_t protocol = cursor_.little_endian(1);
      if (protocol > 5) cursor_.fail("pickle protocol 0-5", std::to_string(protocol));
      return true;
    }
    case PickleOpcode::kFrame: {
      // A frame only says how much a reader may fetch at once; all of it is here already.
      const std::uint64_t length = cursor_.little_endian(8);
      if (length > cursor_.remaining()) {
        cursor_.fail("a frame of at most " + std::to_string(cursor_.remaining()) + " bytes",
                     std::to_string(length));
      }
      return true;
    }
    default:
      return false;
  }
}

void PickleMachine::push_integer(Kind kind, std::int64_t value) { push(kind).integer = value; }

void PickleMachine::push_long(std::string_view bytes) {
  if (bytes.size() > sizeof(std::int64_t)) {
    count_memory(bytes.size());
    push(Kind::kLong).text = bytes;
    return;
  }
  // Two's complement: start from the sign and shift the bytes in from the top one down.
  const bool negative = !bytes.empty() && (bytes.back() & 0x80) != 0;
  std::uint64_t value = negative ? ~std::uint64_t{0} : 0;
  for (std::size_t i = bytes.size(); i-- > 0;) {
    value = value << 8 | static_cast<std::uint8_t>(bytes[i]);
  }
  push_integer(Kind::kInt, static_cast<std::int64_t>(value));
}

void PickleMachine::push_text(Kind kind, std::string_view text) {
  if (kind == Kind::kString && !utf8::is_valid(text)) {
    cursor_.fail("UTF-8", "other bytes in a string");
  }
  count_memory(text.size());
  push(kind).text = text;
}

void PickleMachine::push_items(Kind kind, std::vector<const PickleNode*> items) {
  push(kind).items = std::move(items);
}

std::uint64_t PickleMachine::memo_key_of_line() {
  const std::string_view line = cursor_.line();
  const auto key = parse_pickle_integer(line);
  if (!key || *key < 0) cursor_.fail("a memo number", "\"" + printable(line) + "\"");
  return static_cast<std::uint64_t>(*key);
}

}  // namespace eventgan

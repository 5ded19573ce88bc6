#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// One value of a pickle, as data. Nothing is imported, called or executed: what the pickle wants
/// called is here as a kCall for the reader to interpret.
struct PickleNode {
  enum class Kind {
    kNone,
    kBool,
    kInt,
    kLong,  ///< an integer beyond 64 bits; `text` = its two's complement, little endian
    kFloat,
    kString,
    kBytes,  ///< bytes, and every `str` of Python 2, which may be either
    kList,
    kTuple,
    kDict,
    kGlobal,     ///< `text` = "module.name"
    kCall,       ///< items = {callable (kGlobal), arguments (kTuple)}
    kPersistent  ///< items = {id}; PyTorch's storages
  };
  Kind kind = Kind::kNone;
  std::int64_t integer = 0;  ///< kBool, kInt
  double real = 0;           ///< kFloat
  std::string text;          ///< kString (UTF-8), kBytes, kLong, kGlobal
  /// List, tuple; dictionary as key, value, key, value, ...; call, persistent id as above. A kCall
  /// that builds a container (OrderedDict) gets the items set on it afterwards in `assigned`, as
  /// key, value, ... A key may be there twice; the last one counts.
  std::vector<const PickleNode*> items;
  std::vector<const PickleNode*> assigned;
  const PickleNode* state = nullptr;  ///< what the BUILD opcode gave the object, if anything

  /// The value of a text key (kString or kBytes) of a dictionary or of an OrderedDict call; nullptr
  /// if it is absent. Takes time in proportion to the number of keys.
  const PickleNode* find(std::string_view key) const;
};

/// The kind's name for messages: "a list", "an integer", ...
const char* describe(PickleNode::Kind kind);

/// Item `index` of the node, which must be of that kind. Throws std::runtime_error "expected WHAT,
/// got Y".
const PickleNode& expect_item(const PickleNode& node, std::size_t index, PickleNode::Kind kind,
                              const char* what);

/// Text from a pickle for a message: at most 80 characters, and printable ASCII only.
std::string printable(std::string_view text);

/// A restricted reader of Python pickles, protocols 0-5, for checkpoints and numpy dictionaries. It
/// knows the opcodes such files use and refuses every other, by name; it refuses a global that is
/// not in the allowed set, by name; it never allocates by a length it has not checked against the
/// input, and no nesting is too deep for it. A reader of the nodes must mind that itself: a node
/// may be shared, and a list or dictionary may contain itself. Throws std::runtime_error "expected
/// X, got Y, in NAME at byte N".
class PickleDocument {
 public:
  /// `used` (if given) gets the number of bytes up to and including STOP. A pickle whose values
  /// take more than `most_memory_bytes` is refused.
  PickleDocument(std::span<const std::byte> bytes, const std::set<std::string>& allowed_globals,
                 const std::string& name, std::size_t* used = nullptr,
                 std::uint64_t most_memory_bytes = std::numeric_limits<std::uint64_t>::max());
  PickleDocument(PickleDocument&&) = default;
  PickleDocument(const PickleDocument&) = delete;
  PickleDocument& operator=(PickleDocument&&) = default;
  PickleDocument& operator=(const PickleDocument&) = delete;

  const PickleNode& root() const { return *root_; }

  /// Every value that the pickle made, in that order, whether the root leads to it or not.
  const std::deque<PickleNode>& nodes() const { return nodes_; }

  /// What the values take at most.
  std::uint64_t memory_bytes() const { return memory_bytes_; }

 private:
  std::deque<PickleNode> nodes_;  // owns every node; a deque never moves them
  const PickleNode* root_ = nullptr;
  std::uint64_t memory_bytes_ = 0;
};

}  // namespace eventgan

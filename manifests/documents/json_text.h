#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// Text that comes from data or names of files, as it may be in a line for a person: control
/// characters (U+0000..1F, 7F..9F) as \n, \t or \u001b, bytes that are no UTF-8 as \xff, all else
/// as it is. It can neither steer a terminal nor begin another line then. What it leaves unchanged
/// has none of these.
std::string escape_controls(std::string_view text);

// JSON paths as messages write them: `$` is the document, `$.sources[0].pairs.gaps[2]` a place in
// it.

/// `parent.key`; `parent["odd key"]` where the key is no plain word.
std::string json_path(std::string_view parent, std::string_view key);

/// `parent[index]`.
std::string json_path(std::string_view parent, std::size_t index);

/// Everything that is wrong with one document, in the order found: a reader adds what it finds and
/// goes on, so that its user mends a document once and not once for each fault.
class FaultList {
 public:
  /// `document` stands for the document in every line; mostly its path.
  explicit FaultList(std::string document) : document_(std::move(document)) {}

  /// "DOCUMENT: $.json.path: expected X, got Y"
  void add(std::string_view json_path, std::string_view expected, std::string_view got);

  /// Drops the fault of a required member that is missing, since a key that was meant to be it has
  /// one.
  void drop_missing(std::string_view json_path);

  /// "DOCUMENT:LINE:COLUMN: expected X, got Y" at a byte of the document's text, for what has no
  /// JSON path. Lines and columns count from 1, columns in characters.
  void add_at(std::string_view text, std::size_t byte, std::string_view expected,
              std::string_view got);

  /// From here on keys that nobody asks for are no faults but are named in unknown_keys(): the
  /// document is of a later minor version (format_version.h).
  void allow_unknown_keys() { allows_unknown_keys_ = true; }
  bool allows_unknown_keys() const { return allows_unknown_keys_; }
  void add_unknown_key(std::string_view json_path);

  /// Each once, in places that are told without numbers: `$.shards[].samples[].key`; sorted.
  const std::set<std::string>& unknown_keys() const { return unknown_keys_; }

  bool empty() const { return lines_.empty(); }
  std::size_t count() const { return lines_.size() + left_out_; }

  /// One fault a line, no newline at the end. Beyond a thousand they are only counted. `between`:
  /// what stands for a line's end where the text must be one line.
  std::string text(std::string_view between = "\n") const;

 private:
  void add_line(std::string line);

  std::string document_;
  std::vector<std::string> lines_;
  std::size_t left_out_ = 0;
  bool allows_unknown_keys_ = false;
  std::set<std::string> unknown_keys_;
};

/// Parses a JSON text in which // and /* */ comments are allowed. Stricter than
/// nlohmann::json::parse: the text must be UTF-8 throughout (comments too), without a byte order
/// mark and without NUL (where that parser would stop in silence); a key may be in an object
/// once; values nest at most 32 deep.
///
/// None, and one fault with line and column, if the text cannot be read. A key that is there twice
/// is a fault too, but leaves a document, so that its other faults are found as well.
std::optional<nlohmann::json> parse_json_text(std::string_view text, FaultList& faults);

enum class JsonLayout {
  kLine,
  kAsciiLine,  ///< a line with \u1234 for what is not ASCII, so that no message can garble a
               ///< terminal
  kIndented    ///< a line a value, indented by two
};

/// A document as text, without a line end behind it. What it quotes, such as a path or an
/// annotation, need not be UTF-8, but JSON must be: other bytes become U+FFFD.
std::string dump_json(const nlohmann::json& document, JsonLayout layout = JsonLayout::kLine);
std::string dump_json(const nlohmann::ordered_json& document,
                      JsonLayout layout = JsonLayout::kLine);

enum class JsonComments { kRefused, kPassedOver };

/// Parses data of users, labels and lists of them, keys in the order of the text: as strictly, but
/// that a byte order mark is passed over. Throws std::runtime_error with the first fault, which
/// begins with `name`, the data's place: "NAME: $.a: expected the key once, got it a second time".
nlohmann::ordered_json parse_json_data(std::string_view text, const std::string& name,
                                       JsonComments comments = JsonComments::kRefused);

}  // namespace eventgan

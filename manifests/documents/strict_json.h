#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/format_version.h"
#include "manifests/documents/json_text.h"
#include "manifests/values/words.h"

namespace eventgan {

// A strict reader of JSON documents. It reads as if all were well: where something is not, it adds
// a fault to the list, gives some harmless value, and goes on. When done, the caller looks at the
// list, and must not use what it has read unless the list is empty:
//
//   FaultList faults(file_name);
//   if (const auto document = parse_json_text(text, faults)) {
//     StrictObject object = StrictValue(*document, faults).object();
//     job.seed = object.at("seed").integer(0, 99);
//     if (const auto fit = object.find("fit")) job.fit = fit->choice(kFitWords);
//     object.finish();
//   }
//   if (!faults.empty()) throw UsageError(faults.text());

class StrictObject;

/// One value of a document and its path. Each reading method checks the type first; "integer" means
/// written as one: 9.7 is not, and neither is 9.0. After a fault the harmless value is the lowest,
/// the first or the empty one; the `sound_` methods give none instead, for callers with rules of
/// their own about the value. Holds pointers to the document and the list.
class StrictValue {
 public:
  /// The document as a whole; its path is `$`.
  StrictValue(const nlohmann::json& document, FaultList& faults);

  /// A part of a document that was parsed apart, and its path in the document.
  StrictValue(const nlohmann::json& part, std::string path, FaultList& faults);

  /// A whole number in lowest..highest.
  template <std::signed_integral T>
  T integer(T lowest, T highest) const {
    return static_cast<T>(sound_integer(lowest, highest).value_or(lowest));
  }
  std::optional<std::int64_t> sound_integer(std::int64_t lowest, std::int64_t highest) const;

  /// A number in lowest..highest, whole or not.
  double number(double lowest, double highest) const {
    return sound_number(lowest, highest).value_or(lowest);
  }
  std::optional<double> sound_number(double lowest, double highest) const;

  /// true or false; false after a fault.
  bool boolean() const;
  bool is_boolean() const { return node_ != nullptr && node_->is_boolean(); }
  bool is_null() const { return node_ != nullptr && node_->is_null(); }
  bool is_text() const { return node_ != nullptr && node_->is_string(); }
  bool is_array() const { return node_ != nullptr && node_->is_array(); }

  /// A string, any; or one for which `is_right` holds, which `expected` puts in words.
  std::string text() const;
  std::string text(std::string_view expected, bool (*is_right)(std::string_view)) const;

  /// The value of the enumeration that the string names.
  template <class T, std::size_t N>
  T choice(const std::array<Word<T>, N>& words) const {
    return sound_choice(words).value_or(words[0].value);
  }
  template <class T, std::size_t N>
  std::optional<T> sound_choice(const std::array<Word<T>, N>& words) const {
    std::array<std::string_view, N> names;
    for (std::size_t i = 0; i < N; ++i) names[i] = words[i].word;
    const std::optional<std::size_t> index = index_of_choice(names);
    return index ? std::optional(words[*index].value) : std::nullopt;
  }

  /// The elements of an array that has at least `least` of them.
  std::vector<StrictValue> elements(std::size_t least = 0) const;

  /// The members of an object whose keys are free, sorted by key.
  std::vector<std::pair<std::string, StrictValue>> members() const;

  /// An object whose keys are known.
  StrictObject object() const;

  /// Adds a fault about this value, for rules beyond type and range; `got` if not the value itself.
  void fault(std::string_view expected) const;
  void fault(std::string_view expected, std::string_view got) const;
  const FaultList& faults() const { return *faults_; }

 private:
  friend class StrictObject;
  enum class State {
    kPresent,
    kMissing,  // a required key's: a fault as soon as it is read, since only then it is known what
               // for
    kSilent    // below something faulty: its fault is reported already
  };

  StrictValue(const nlohmann::json* node, State state, std::string path, FaultList& faults);

  std::optional<std::size_t> index_of_choice(std::span<const std::string_view> words) const;
  std::string description() const;

  const nlohmann::json* node_;  // null unless present
  State state_;
  std::string path_;
  FaultList* faults_;
};

/// An object all of whose keys are known: those asked for. Keys are string literals: they must
/// outlive the reader.
class StrictObject {
 public:
  /// A required member. If it is missing, reading it is a fault.
  StrictValue at(std::string_view key);

  /// A member that may be missing.
  std::optional<StrictValue> find(std::string_view key);

  /// Whether the members `format` and `version` are these. Where they are not, that is a fault, and
  /// the rest had better not be read: it is another kind of document.
  bool has_format(std::string_view format, int version);

  /// The same of a format whose version is "MAJOR.MINOR": whether this program reads it. Of a later
  /// minor version, unknown keys are named and passed over (FaultList::allow_unknown_keys).
  bool has_format(std::string_view format, FormatVersion own);

  /// Adds a fault for each member never asked for, naming the key that may have been meant, or
  /// names it as unknown in a document of a later minor version. Call it once everything has been
  /// asked for.
  void finish() const;

 private:
  friend class StrictValue;
  StrictObject(const nlohmann::json* node, std::string path, FaultList& faults);
  bool has_format_name(std::string_view format);

  const nlohmann::json* node_;  // null below something faulty
  std::string path_;
  FaultList* faults_;
  std::vector<std::string_view> known_;
};

/// The word of `known` that `word` was most likely meant to be: the one fewest edits away, if these
/// are at most a third of its letters (one for short words). Empty if none is so close.
std::string_view near_word(std::string_view word, std::span<const std::string_view> known);

}  // namespace eventgan

#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/documents/strict_json.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"

namespace eventgan {

/// The words of a table's rows for which `holds` does.
template <class Row, std::size_t N, class Holds>
std::vector<std::string_view> words_where(const std::array<Row, N>& rows, const Holds& holds) {
  std::vector<std::string_view> words;
  for (const Row& row : rows) {
    if (std::invoke(holds, row)) words.push_back(row.word);
  }
  return words;
}

/// The table of a document's fields: a function that tells a struct's members, each by key, type,
/// and what it is. The same function reads the document strictly, describes it as a JSON Schema,
/// and writes it:
///
///   void list_fit(Fields& fields, FitSpec& spec) {
///     fields.at("name", spec.name, name_text(), "Name of the fit.");
///     fields.find("gap_s", spec.gap_s, numbers(0, 60), "Seconds between two frames.");
///   }
///
/// What a member holds before is the field's default. Types are below: values with
///   void read(const StrictValue&, T&), Schema schema(const T& default), Schema json(const T&).
/// Rules on more than one field stand between the fields, on the values that were found: none is
/// when a document is described or written. What a schema can say of such a rule is in rule().
class Fields {
 public:
  using Schema = nlohmann::ordered_json;

  /// Reads `value`, which must be an object.
  explicit Fields(const StrictValue& value) : object_(value.object()) {}
  static Fields describing() { return Fields(true); }
  static Fields writing() { return Fields(false); }

  bool is_reading() const { return object_.has_value(); }
  bool is_describing() const { return schema_.has_value(); }
  bool is_writing() const { return !object_ && !schema_; }

  /// The document's format and version; false if it is another's: then there is nothing to read.
  bool has_format(std::string_view format, int version);

  /// A field that must be there; and one that may be missing, or, when writing, is empty. The value
  /// that was found.
  template <class T, class Type>
  std::optional<StrictValue> at(std::string_view key, T& member, const Type& type,
                                std::string_view what) {
    return field(key, member, type, what, /*is_required=*/true);
  }
  template <class T, class Type>
  std::optional<StrictValue> find(std::string_view key, T& member, const Type& type,
                                  std::string_view what) {
    return field(key, member, type, what, /*is_required=*/false);
  }

  /// The field that says of which kind the object is: what only_for() asks about.
  template <class T, class Type>
  void kind_at(std::string_view key, T& member, const Type& type, std::string_view what) {
    at(key, member, type, what);
    set_kind(key, type.word(member), "");
  }
  template <class T, class Type>
  void kind(std::string_view key, T& member, const Type& type, std::string_view what) {
    const std::string_view fallback = type.word(member);
    find(key, member, type, what);
    set_kind(key, type.word(member), fallback);
  }

  /// In an object within one of that kind, what only_for() asks about; none if the kind is faulty.
  /// What a schema says of it is a rule of the outer object.
  void within(std::string_view key, std::string_view kind) {
    kind_key_ = key;
    kind_ = kind;
  }
  std::string_view found_kind() const { return kind_; }  ///< none if it is faulty

  using Kinds = std::vector<std::string_view>;

  /// Fields of some kinds alone: `fields.only_for({kEsim}).find(...)`; `at`: which these need.
  class Only {
   public:
    /// Which kinds may have a key, and which must.
    struct Owners {
      Kinds may, must;
    };
    Only(Fields& fields, std::function<Owners(std::string_view key)> owners)
        : fields_(fields), owners_(std::move(owners)) {}
    template <class T, class Type>
    std::optional<StrictValue> at(std::string_view key, T& member, const Type& type,
                                  std::string_view what) {
      const Kinds may = owners_(key).may;
      return fields_.owned(key, member, type, what, {may, may});
    }
    template <class T, class Type>
    std::optional<StrictValue> find(std::string_view key, T& member, const Type& type,
                                    std::string_view what) {
      return fields_.owned(key, member, type, what, owners_(key));
    }

   private:
    Fields& fields_;
    std::function<Owners(std::string_view key)> owners_;
  };
  Only only_for(const Kinds& owners) {
    return {*this, [owners](std::string_view) { return Only::Owners{owners, {}}; }};
  }
  template <class Kind>
  requires std::is_enum_v<Kind> Only only_for(std::initializer_list<Kind> owners) {
    Kinds words;
    for (const Kind owner : owners) words.push_back(to_string(owner));
    return only_for(words);
  }

  /// The same where a table has a row for each kind, and `takes(row, key)` says which may have it;
  /// a row's `required_key`, if it has such, must be there.
  template <class Row, std::size_t N>
  Only taken_by(const std::array<Row, N>& rows) {
    return {*this, [&rows](std::string_view key) {
              Only::Owners owners;
              owners.may = words_where(rows, [key](const Row& row) { return takes(row, key); });
              if constexpr (requires { rows[0].required_key; }) {
                owners.must =
                    words_where(rows, [key](const Row& row) { return row.required_key == key; });
              }
              return owners;
            }};
  }

  /// `second` is only of use beside `first`.
  void needs(std::string_view second, std::string_view first);

  /// `first` sets the others, which have no place beside it.
  void sets(std::string_view first, std::initializer_list<std::string_view> others);

  /// What the schema says beside the fields: a JSON text, or a value.
  void rule(const char* schema) {
    if (schema_) rule(Schema::parse(schema));
  }
  void rule(const Schema& schema);

  /// The value of a key, if it is there and its kind may have it; no key is a fault by that.
  std::optional<StrictValue> peek(std::string_view key) {
    const bool is_misplaced = std::ranges::find(misplaced_, key) != misplaced_.end();
    return object_ && !is_misplaced ? object_->find(key) : std::nullopt;
  }

  /// When reading: a fault of this key, whether it is there or not.
  void fault(std::string_view key, std::string_view expected) { object_->at(key).fault(expected); }

  /// Whether what was read of this key is without a fault.
  bool is_sound(std::string_view key) const {
    return std::ranges::find(faulty_, key) == faulty_.end();
  }

  /// When all fields were told: unknown keys are faults, once.
  void finish() {
    if (object_ && !std::exchange(is_finished_, true)) object_->finish();
  }
  Schema schema() const;
  const Schema& json() const { return json_; }

 private:
  friend class Only;
  explicit Fields(bool describes) {
    if (describes) schema_.emplace();
  }

  template <class T, class Type>
  std::optional<StrictValue> field(std::string_view key, T& member, const Type& type,
                                   std::string_view what, bool is_required) {
    if (object_) {
      auto found = is_required ? std::optional(object_->at(key)) : object_->find(key);
      if (found) read(*found, key, member, type);
      return found;
    }
    if (schema_) {
      describe(key, schema_of(member, type), what, is_required);
      constexpr bool kHasParts = requires { type.list; };  // they state defaults of their own
      if (!is_required && !kHasParts) state_default(key, json_of(member, type));
    } else if (const Schema value = json_of(member, type); is_required || !is_empty(value)) {
      json_[std::string(key)] = value;
    }
    return std::nullopt;
  }

  template <class T, class Type>
  void read(const StrictValue& found, std::string_view key, T& member, const Type& type) {
    const std::size_t before = found.faults().count();
    if constexpr (requires { type.read(found, member); }) {
      type.read(found, member);
    } else {
      type.read(found, member.emplace());
    }
    if (found.faults().count() != before) faulty_.push_back(key);
  }
  template <class T, class Type>
  static Schema schema_of(const T& member, const Type& type) {
    if constexpr (requires { type.schema(member); }) {
      return type.schema(member);
    } else {
      return type.schema(member.value_or(typename T::value_type{}));
    }
  }
  template <class T, class Type>
  static Schema json_of(const T& member, const Type& type) {
    if constexpr (requires { type.json(member); }) {
      return type.json(member);
    } else {
      return member ? type.json(*member) : Schema();
    }
  }

  static bool is_empty(const Schema& value) {
    return value.is_null() || value.empty() || value == "";
  }
  void describe(std::string_view key, const Schema& schema, std::string_view what,
                bool is_required);
  void state_default(std::string_view key, const Schema& value);
  void set_kind(std::string_view key, std::string_view word, std::string_view fallback);
  bool may_have(std::string_view key, const Only::Owners& owners);
  static std::string of_kinds(const Only::Owners& owners, std::string_view what);

  template <class T, class Type>
  std::optional<StrictValue> owned(std::string_view key, T& member, const Type& type,
                                   std::string_view what, const Only::Owners& owners) {
    if (!may_have(key, owners)) return std::nullopt;
    const bool must = std::ranges::find(owners.must, kind_) != owners.must.end();
    return field(key, member, type, of_kinds(owners, what), !is_describing() && must);
  }

  /// What a schema says of kinds: the keys that no others have, and those that these need.
  struct Owned {
    Kinds owners;
    std::vector<std::string> keys, required;
  };
  Owned& owned_by(const Kinds& owners);

  std::optional<StrictObject> object_;  // when reading
  std::vector<std::string_view> faulty_, misplaced_;
  bool is_finished_ = false;
  std::optional<Schema> schema_;  // when describing
  std::vector<Owned> owned_;
  Schema json_ = Schema::object();  // when writing
  std::string_view kind_key_, kind_, default_kind_;
};

using Schema = Fields::Schema;

// Types of fields.

struct Integers {
  std::int64_t least, most;
  template <std::integral T>
  requires(!std::same_as<T, bool>) void read(const StrictValue& value, T& member) const {
    member = static_cast<T>(value.integer<std::int64_t>(least, most));
  }
  template <std::integral T>
  Schema schema(const T&) const {
    return {{"type", "integer"}, {"minimum", least}, {"maximum", most}};
  }
  template <std::integral T>
  Schema json(const T& member) const {
    return member;
  }
};
inline Integers integers(std::int64_t least, std::int64_t most) { return {least, most}; }
inline Integers seeds() { return {0, INT64_MAX}; }

struct Numbers {
  double least, most;
  void read(const StrictValue& value, double& member) const { member = value.number(least, most); }
  Schema schema(double) const;
  Schema json(double member) const;
};
inline Numbers numbers(double least, double most) { return {least, most}; }

struct Booleans {
  void read(const StrictValue& value, bool& member) const { member = value.boolean(); }
  Schema schema(bool) const { return {{"type", "boolean"}}; }
  Schema json(bool member) const { return member; }
};
inline Booleans booleans() { return {}; }

/// Text: any, or of the form that `is_right` asks for and `expected` puts in words.
struct Texts {
  std::string_view expected = "text";
  bool (*is_right)(std::string_view) = [](std::string_view) { return true; };
  std::string_view form = R"({"type": "string"})";  ///< the same as a schema
  void read(const StrictValue& value, std::string& member) const {
    member = value.text(expected, is_right);
  }
  Schema schema(const std::string&) const { return Fields::Schema::parse(form); }
  Schema json(const std::string& member) const { return member; }
};
inline Texts texts() { return {}; }
Texts paths();           ///< not empty, and without NUL, at which the file system would cut it
Texts names();           ///< parts of file names (is_name)
Texts stereo_cameras();  ///< left or right

/// Words of an enumeration.
template <class T, std::size_t N>
struct Words {
  const std::array<Word<T>, N>& table;
  std::string_view word(const T& member) const { return word_of(table, member); }
  void read(const StrictValue& value, T& member) const {
    if (const auto choice = value.sound_choice(table)) member = *choice;
  }
  Schema schema(const T&) const {
    Fields::Schema list = Fields::Schema::array();
    for (const Word<T>& entry : table) list.push_back(entry.word);
    return {{"enum", list}};
  }
  Schema json(const T& member) const { return word(member); }
};
template <class T, std::size_t N>
Words<T, N> words(const std::array<Word<T>, N>& table) {
  return {table};
}

/// How the second of two numbers lies to the first.
enum class Ends { kAnyOrder, kNotBelow, kAbove };

/// [first, second]; with `or_number` also a number, which stands for both.
struct Pairs {
  double least, most;
  Ends ends;
  bool or_number;
  void read(const StrictValue& value, std::array<double, 2>& member) const;
  Schema schema(const std::array<double, 2>&) const;
  Schema json(const std::array<double, 2>& member) const;
};
inline Pairs pairs_of(double least, double most, Ends ends = Ends::kNotBelow) {
  return {least, most, ends, false};
}
inline Pairs ranges(double least, double most) { return {least, most, Ends::kNotBelow, true}; }

/// An object, whose own table `list(Fields&, T&)` is.
template <class T, class List>
struct Objects {
  List list;
  void read(const StrictValue& value, T& member) const {
    Fields fields(value);
    list(fields, member);
    fields.finish();
  }
  Schema schema(T defaults) const {
    Fields fields = Fields::describing();
    list(fields, defaults);
    return fields.schema();
  }
  Schema json(T member) const {
    Fields fields = Fields::writing();
    list(fields, member);
    return fields.json();
  }
};
template <class T>
auto objects(void (*list)(Fields&, T&)) {
  return Objects<T, void (*)(Fields&, T&)>{list};
}
template <class T, class List>
auto objects(List list) {
  return Objects<T, List>{list};
}

/// Width and height, each least..most.
struct Sizes {
  int least, most;
  void read(const StrictValue& value, ImageSize& member) const;
  Schema schema(const ImageSize&) const;
  Schema json(const ImageSize& member) const;
};
inline Sizes sizes(int least, int most) { return {least, most}; }

/// An array of at least so many.
template <class Type>
struct Lists {
  Type type;
  std::size_t least;
  template <class T>
  void read(const StrictValue& value, std::vector<T>& member) const {
    member.clear();
    for (const StrictValue& element : value.elements(least))
      type.read(element, member.emplace_back());
  }
  template <class T>
  Schema schema(const std::vector<T>&) const {
    Fields::Schema schema = {{"type", "array"}};
    if (least > 0) schema["minItems"] = least;
    schema["items"] = type.schema(T{});
    return schema;
  }
  template <class T>
  Schema json(const std::vector<T>& member) const {
    Fields::Schema list = Fields::Schema::array();
    for (const T& element : member) list.push_back(type.json(element));
    return list;
  }
};
template <class Type>
Lists<Type> lists(Type type, std::size_t least) {
  return {type, least};
}

/// Gaps between two frames, each once; in the order of their size.
struct Gaps {
  PairSide side = PairSide::kBefore;
  void read(const StrictValue& value, std::vector<int>& member) const;
  Schema schema(const std::vector<int>&) const;
  Schema json(const std::vector<int>& member) const { return member; }
};

}  // namespace eventgan

#include "manifests/documents/json_text.h"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <unordered_set>
#include <utility>
#include <vector>

namespace eventgan {

namespace {

std::string hex(unsigned char byte) {
  constexpr char kDigits[] = "0123456789abcdef";
  return {kDigits[byte >> 4], kDigits[byte & 15]};
}

}  // namespace

std::string escape_controls(std::string_view text) {
  std::string shown;
  while (true) {
    const std::size_t sound = std::min(utf8::find_invalid(text), text.size());
    for (auto at = text.begin(), end = at + static_cast<std::ptrdiff_t>(sound); at != end;) {
      const auto begin = at;
      const auto character = utf8::unchecked::next(at);
      if (character == '\n') {
        shown += "\\n";
      } else if (character == '\t') {
        shown += "\\t";
      } else if (character < 0x20 || (character >= 0x7f && character < 0xa0)) {
        shown += "\\u00" + hex(static_cast<unsigned char>(character));
      } else {
        shown.append(begin, at);
      }
    }
    if (sound == text.size()) return shown;
    shown += "\\x" + hex(static_cast<unsigned char>(text[sound]));
    text.remove_prefix(sound + 1);
  }
}

std::string json_path(std::string_view parent, std::string_view key) {
  const bool is_word = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return c < 0x80 && (std::isalnum(c) || c == '_');
  });
  std::string path(parent);
  if (is_word) return path.append(".").append(key);
  const std::string quoted = dump_json(nlohmann::json(key), JsonLayout::kAsciiLine);
  return path.append("[").append(quoted).append("]");
}

std::string json_path(std::string_view parent, std::size_t index) {
  return std::string(parent) + "[" + std::to_string(index) + "]";
}

namespace {

constexpr std::size_t kMostLines = 1000;

std::string expectation(std::string_view expected, std::string_view got) {
  return std::string(": expected ").append(expected).append(", got ").append(got);
}

}  // namespace

void FaultList::add(std::string_view json_path, std::string_view expected, std::string_view got) {
  add_line(document_ + ": " + std::string(json_path) + expectation(expected, got));
}

void FaultList::drop_missing(std::string_view json_path) {
  const std::string begin = document_ + ": " + std::string(json_path) + ": expected ";
  std::erase_if(lines_, [&](const std::string& line) {
    return line.starts_with(begin) && line.ends_with(", got nothing");
  });
}

void FaultList::add_at(std::string_view text, std::size_t byte, std::string_view expected,
                       std::string_view got) {
  const std::string_view before = text.substr(0, byte);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::string_view in_line = before.substr(before.rfind('\n') + 1);  // npos + 1 == 0
  const auto column = 1 + std::count_if(in_line.begin(), in_line.end(), [](unsigned char c) {
                        return (c & 0xc0) != 0x80;  // UTF-8: the first byte of each character
                      });
  add_line(document_ + ":" + std::to_string(line) + ":" + std::to_string(column) +
           expectation(expected, got));
}

void FaultList::add_line(std::string line) {
  if (lines_.size() == kMostLines) {
    ++left_out_;
  } else {
    lines_.push_back(std::move(line));
  }
}

void FaultList::add_unknown_key(std::string_view json_path) {
  std::string place;
  for (const char c : json_path) {
    const bool is_index = place.ends_with('[') && c >= '0' && c <= '9';
    if (!is_index) place += c;
  }
  unknown_keys_.insert(std::move(place));
}

std::string FaultList::text(std::string_view between) const {
  std::string text = fmt::format("{}", fmt::join(lines_, between));
  if (left_out_ > 0) {
    text += fmt::format("{}{}: and {} more faults", between, document_, left_out_);
  }
  return text;
}

namespace {

constexpr std::size_t kDeepest = 32;

/// Byte of the first character that is not well-formed UTF-8 (no overlong forms, no surrogates), or
/// of the first NUL; text.size() if there is none. The parser itself looks into strings only.
std::size_t first_unsound_byte(std::string_view text) {
  const std::size_t nul = std::min(text.find('\0'), text.size());
  return std::min(utf8::find_invalid(text.substr(0, nul)), nul);
}

template <class Json>
std::string dump(const Json& document, JsonLayout layout) {
  return document.dump(layout == JsonLayout::kIndented ? 2 : -1, ' ',
                       layout == JsonLayout::kAsciiLine, Json::error_handler_t::replace);
}

/// Builds the document from the parser's events, since the parser's own builder lets a second key
/// overwrite the first without a word.
template <class Json>
class Builder : public nlohmann::json_sax<Json> {
 public:
  Builder(std::string_view text, FaultList& faults) : text_(text), faults_(faults) {}

  Json& document() { return document_; }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(std::int64_t value) override { return add(value); }
  bool number_unsigned(std::uint64_t value) override { return add(value); }
  bool number_float(double value, const std::string&) override { return add(value); }
  bool string(std::string& value) override { return add(std::move(value)); }
  bool binary(typename Json::binary_t&) override { return false; }  // no such thing in JSON text
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(std::string& value) override {
    const bool is_new = open_.back().keys.insert(value).second;
    open_.back().key = std::move(value);
    if (!is_new) faults_.add(path(), "the key once", "it twice");
    return true;
  }

  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& error) override {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error while ...":
    // what is of use to the reader follows the last of the introductions.
    std::string reason = error.what();
    for (const std::string_view introduction : {"] ", "syntax error "}) {
      const std::size_t at = reason.find(introduction);
      if (at != std::string::npos) reason.erase(0, at + introduction.size());
    }
    // Of an empty text newer versions of the library say something else, and more than helps.
    if (text_.empty()) reason = "while parsing value - unexpected end of input";
    constexpr std::size_t kLongest = 200;  // it quotes what it read last, which may be a whole line
    if (reason.size() > kLongest) {
      std::size_t end = kLongest;
      while ((reason[end] & 0xc0) == 0x80) --end;  // not within a character
      reason = reason.substr(0, end) + "...";
    }
    // The parser has read the byte it stumbles over, even if that is the end.
    faults_.add_at(text_, position == 0 ? 0 : position - 1, "JSON", "an error " + reason);
    return false;
  }

 private:
  struct Level {
    Json* node;
    std::string key;
    std::unordered_set<std::string> keys = {};  ///< of an object
  };

  /// The place of the next value.
  std::string path() const {
    std::string path = "$";
    for (const Level& level : open_) {
      // The child of an array that is open is its last element.
      const bool is_last = &level == &open_.back();
      path = level.node->is_object() ? json_path(path, level.key)
                                     : json_path(path, level.node->size() - (is_last ? 0 : 1));
    }
    return path;
  }

  Json* place(Json value) {
    if (open_.empty()) return &(document_ = std::move(value));
    Json& parent = *open_.back().node;
    if (parent.is_object()) {
      auto& members = parent.template get_ref<typename Json::object_t&>();
      if constexpr (std::is_same_v<Json, nlohmann::ordered_json>) {
        // Its own insertion looks at all earlier keys first: they are known to be others.
        auto& entries = static_cast<std::vector<typename Json::object_t::value_type>&>(members);
        return &entries.emplace_back(open_.back().key, std::move(value)).second;
      } else {
        return &(members[open_.back().key] = std::move(value));
      }
    }
    parent.push_back(std::move(value));
    return &parent.back();
  }

  bool add(Json value) {
    place(std::move(value));
    return true;
  }

  bool open(Json container) {
    if (open_.size() == kDeepest) {
      faults_.add(path(), "at most " + std::to_string(kDeepest) + " levels of nesting", "more");
      return false;
    }
    open_.push_back({place(std::move(container)), {}});
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  std::string_view text_;
  FaultList& faults_;
  Json document_;
  std::vector<Level> open_;  // the values that are not closed yet, outermost first
};

template <class Json>
std::optional<Json> parse_text(std::string_view text, FaultList& faults, bool ignore_comments) {
  if (const std::size_t at = first_unsound_byte(text); at < text.size()) {
    faults.add_at(text, at, "UTF-8 text",
                  "the byte 0x" + hex(static_cast<unsigned char>(text[at])));
    return std::nullopt;
  }
  Builder<Json> builder(text, faults);
  const bool strict = true;
  if (!Json::sax_parse(text, &builder, Json::input_format_t::json, strict, ignore_comments)) {
    return std::nullopt;
  }
  return std::move(builder.document());
}

}  // namespace

std::string dump_json(const nlohmann::json& document, JsonLayout layout) {
  return dump(document, layout);
}

std::string dump_json(const nlohmann::ordered_json& document, JsonLayout layout) {
  return dump(document, layout);
}

std::optional<nlohmann::json> parse_json_text(std::string_view text, FaultList& faults) {
  if (text.starts_with("\xef\xbb\xbf")) {
    faults.add_at(text, 0, "UTF-8 without a byte order mark", "a byte order mark");
    return std::nullopt;
  }
  return parse_text<nlohmann::json>(text, faults, /*ignore_comments=*/true);
}

nlohmann::ordered_json parse_json_data(std::string_view text, const std::string& name,
                                       JsonComments comments) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  FaultList faults(name);
  auto document =
      parse_text<nlohmann::ordered_json>(text, faults, comments == JsonComments::kPassedOver);
  if (!faults.empty()) {
    const std::string all = faults.text();
    throw std::runtime_error(all.substr(0, all.find('\n')));
  }
  return *std::move(document);
}

}  // namespace eventgan

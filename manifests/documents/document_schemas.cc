#include "manifests/documents/document_schemas.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/json_text.h"

namespace eventgan {
namespace {

struct DocumentKind {
  std::string_view file;
  std::string_view title;
  std::string_view what;
  std::vector<std::string_view> beyond;  ///< what a schema cannot say
  Schema schema;
};

template <class T>
Schema schema_of(void (*list)(Fields&, T&)) {
  return objects(list).schema(T());
}

std::vector<DocumentKind> document_kinds() {
  return {
      {"manifest.schema.json",
       "eventgan job manifest, version 1",
       "A job of `eventgan convert`: which labelled datasets become which HDF5 shards of event "
       "volumes.",
       {"of a range the second number is not below the first, and of fraction above it",
        "a volume stays below 4 GiB (2 x bins x height x width x bytes of dtype)"},
       schema_of(list_job)},
      {"simulation.schema.json",
       "eventgan simulation manifest, version 1",
       "A job of `eventgan simulate`: which clips become which event recordings, by which sensor.",
       {"no two recordings have one name", "a source without a name has a path whose stem is one"},
       schema_of(list_simulation)},
      {"training.schema.json",
       "eventgan training manifest, version 1",
       "A job of `eventgan train`: from which event recordings a generator learns, and how.",
       {"last_frame lies after first_frame", "of a range the second number is not below the first",
        "with adversarial loss the batch is even and the crop at least 48 a side",
        "a generator trained through a loss has steps of that loss's phase",
        "some phase has steps, and a generator some loss"},
       schema_of(list_training)},
      {"sensor.schema.json",
       "eventgan sensor, version 1",
       "An event camera: what convert needs of it, as `eventgan fit` finds it.",
       {"a range's second number is not below its first"},
       schema_of(list_camera_sensor)}};
}

/// JSON from `column` on: on one line of up to 120, or its members on some, objects on their own.
std::string laid_out(const Schema& value, std::size_t indent = 0, std::size_t column = 0) {
  constexpr std::size_t kWidth = 119;  // and a comma
  if (!value.is_structured() || value.empty()) return dump_json(value);
  const std::string margin = "\n" + std::string(indent + 2, ' ');
  std::string line, lines;
  std::size_t used = kWidth;  // of the last one of `lines`
  for (const auto& [key, member] : value.items()) {
    const std::string name = value.is_object() ? dump_json(Schema(key)) + ": " : "";
    const std::string text = name + laid_out(member, indent + 2, indent + 2 + name.size());
    const bool is_line = !member.is_object() && text.find('\n') == text.npos;
    const bool stays = is_line && used + 2 + text.size() <= kWidth;
    line += (line.empty() ? "" : ", ") + text;
    lines += (lines.empty() ? "" : stays ? ", " : ",") + (stays ? "" : margin) + text;
    used = is_line ? (stays ? used + 2 : indent + 2) + text.size() : kWidth;
  }
  const std::string_view ends = value.is_object() ? "{}" : "[]";
  const bool fits = column + line.size() + 2 <= kWidth && line.find('\n') == line.npos;
  return fits ? ends[0] + line + ends[1] : ends[0] + lines + margin.substr(0, indent + 1) + ends[1];
}

/// The text with what Markdown would take for a mark of its own escaped.
std::string cell(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|' || c == '<' || c == '*') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

/// A property's type, range and choices, in a few words.
std::string type_in_words(const Schema& property) {
  std::vector<std::string> choices;
  if (property.contains("const")) return "`" + property.at("const").dump() + "`";
  if (property.contains("enum")) {
    for (const Schema& word : property.at("enum")) {
      choices.push_back("`" + (word.is_string() ? word.get<std::string>() : word.dump()) + "`");
    }
    return fmt::format("{}", fmt::join(choices, ", "));
  }
  if (property.contains("title")) return property.at("title");
  if (property.contains("anyOf")) {
    for (const Schema& choice : property.at("anyOf")) choices.push_back(type_in_words(choice));
    return fmt::format("{}", fmt::join(choices, ", or "));
  }
  const std::string type = property.value("type", "");
  if (type == "boolean") return "`true`, `false`";
  if (type == "string") return "text";
  if (type == "object") return "object";
  if (type == "array") {
    const std::string items = type_in_words(property.at("items"));
    return (property.contains("maxItems") ? "two: " : "list: ") + items;
  }
  return fmt::format("{} {} to {}", type, property.at("minimum").dump(),
                     property.at("maximum").dump());
}

void add_rows(const Schema& object, const std::string& place, std::string& page) {
  const Schema required = object.value("required", Schema::array());
  for (const auto& [key, property] : object.at("properties").items()) {
    const std::string path = place + key;
    const bool is_required = std::find(required.begin(), required.end(), key) != required.end();
    const std::string fallback = is_required ? "required"
                                 : property.contains("default")
                                     ? "`" + property.at("default").dump() + "`"
                                     : "";
    page += fmt::format("| `{}` | {} | {} | {} |\n", path, cell(type_in_words(property)),
                        cell(fallback), cell(property.value("description", "")));
    const bool is_list = property.contains("items");
    const Schema& inner = is_list ? property.at("items") : property;
    if (inner.contains("properties")) add_rows(inner, path + (is_list ? "[]." : "."), page);
    for (const Schema& choice : inner.value("anyOf", Schema::array())) {
      const bool is_told_elsewhere = choice.contains("title");
      if (choice.contains("properties") && !is_told_elsewhere) add_rows(choice, path + ".", page);
    }
  }
}

}  // namespace

std::map<std::string, std::string> document_schemas() {
  std::map<std::string, std::string> schemas;
  for (const DocumentKind& kind : document_kinds()) {
    Schema schema = {
        {"$schema", "http://json-schema.org/draft-07/schema#"},
        {"title", kind.title},
        {"description",
         fmt::format("{} Comments are allowed. Relative paths start at the document's folder. What "
                     "a schema cannot say, and the program checks beyond it: a key may be in an "
                     "object once; an integer is written as one (9, not 9.0); {}.",
                     kind.what, fmt::join(kind.beyond, "; "))}};
    schema.update(kind.schema);
    schemas[std::string(kind.file)] = laid_out(schema) + "\n";
  }
  return schemas;
}

std::string keys_page() {
  std::string page =
      "# Keys of the manifests\n\n"
      "Every key of the documents that people write: its values, its default, and what it is. `[]` "
      "stands for the elements\nof a list. The program makes this page and the JSON Schemas in "
      "`manifests/schemas` from the tables that it reads the\ndocuments by.\n";
  for (const DocumentKind& kind : document_kinds()) {
    page += fmt::format("\n## {}\n\n{}\nBeyond the table:\n\n", kind.title, kind.what);
    for (const std::string_view rule : kind.beyond) page += fmt::format("- {}\n", rule);
    page += "\n";
    page += "| key | values | default | what it is |\n|---|---|---|---|\n";
    add_rows(kind.schema, "", page);
  }
  return page;
}

}  // namespace eventgan

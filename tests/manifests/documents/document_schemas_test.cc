#include "manifests/documents/document_schemas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "manifests/documents/detail/fields.h"
#include "manifests/documents/manifest_fields.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using nlohmann::json;

void expect_in_tree(const std::string& file, const std::string& made) {
  const std::filesystem::path path =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / file;
  EXPECT_TRUE(testing::is_as_made(path, made))
      << path << " is not what the tables of fields give; EVENTGAN_WRITE_MADE_FILES=1 writes it";
}

TEST(DocumentSchemas, AreThoseOfTheTree) {
  for (const auto& [name, schema] : document_schemas()) expect_in_tree("schemas/" + name, schema);
}

TEST(KeysPage, HasARowForEachKey) {
  EXPECT_THAT(
      keys_page(),
      ::testing::AllOf(
          ::testing::HasSubstr(
              "| `recordings[].weight` | number 1e-06 to 1000000 | `1` | Relative"),
          ::testing::HasSubstr("| `recordings[].path` | path | required | The file"),
          ::testing::HasSubstr(
              "| `recordings[].rectify` | `true`, `false` | `false` | dsec: moves"),
          ::testing::HasSubstr("| `optimizer.betas` | two: number 0 to 0.999999 | `[0,0.999]` |")));
}

enum class Shape { kDot, kLine };
constexpr std::array kShapes{Word<Shape>{"dot", Shape::kDot}, Word<Shape>{"line", Shape::kLine}};
std::string_view to_string(Shape shape) { return word_of(kShapes, shape); }

struct Drawn {
  Shape shape = Shape::kDot;
  double length = 2.5;
  int width = 1;
  std::string note;
  std::optional<std::array<double, 2>> range;
  std::vector<int> numbers_left;
};

void list_drawn(Fields& fields, Drawn& drawn) {
  if (!fields.has_format("drawn", 1)) return;
  fields.kind("shape", drawn.shape, words(kShapes), "What it is.");
  fields.only_for({Shape::kLine}).at("length", drawn.length, numbers(0, 9), "how long it is.");
  fields.find("width", drawn.width, integers(1, 3), "How wide.");
  fields.find("note", drawn.note, texts(), "For people.");
  fields.find("range", drawn.range, ranges(0, 1), "Where.");
  fields.needs("range", "note");
  fields.rule(R"({"properties": {"width": {"maximum": 2}}})");
}

struct ShapeRow {
  std::string_view word, key, required_key;
};
constexpr std::array kShapeRows{ShapeRow{"dot", "note", ""}, ShapeRow{"line", "length", "length"}};
bool takes(const ShapeRow& row, std::string_view key) { return row.key == key; }

void list_by_rows(Fields& fields, Drawn& drawn) {
  fields.kind_at("shape", drawn.shape, words(kShapes), "What it is.");
  Fields::Only some = fields.taken_by(kShapeRows);
  some.find("length", drawn.length, numbers(0, 9), "how long it is.");
  some.find("note", drawn.note, texts(), "for people.");
  fields.find("width", drawn.width, integers(1, 3), "How wide.");
  fields.sets("note", {"width"});
}

/// What a table says of a text: faults, or what was read, written again.
std::string read_again(const char* text, void (*list)(Fields&, Drawn&) = list_drawn) {
  FaultList faults("d");
  const json document = json::parse(text);
  Drawn drawn;
  objects(list).read(StrictValue(document, faults), drawn);
  return faults.empty() ? objects(list).json(drawn).dump() : faults.text();
}

TEST(Fields, AreReadAndWritten) {
  EXPECT_EQ(read_again(R"({"format": "drawn", "version": 1})"),
            R"({"format":"drawn","version":1,"shape":"dot","width":1})");
  EXPECT_EQ(
      read_again(R"({"format": "drawn", "version": 1, "shape": "line", "length": 4, "width": 3,
                           "note": "n", "range": 0.5})"),
      R"({"format":"drawn","version":1,"shape":"line","length":4.0,"width":3,"note":"n","range":0.5})");
  EXPECT_EQ(
      read_again(R"({"format": "drawn", "version": 1, "note": "n", "range": [0.25, 0.5]})"),
      R"({"format":"drawn","version":1,"shape":"dot","width":1,"note":"n","range":[0.25,0.5]})");
}

TEST(Fields, HaveTheirFaultsTogether) {
  EXPECT_EQ(read_again(R"({"format": "drawn", "version": 1, "length": 4, "width": 4, "range": 0.5,
                           "nots": ""})"),
            "d: $.length: expected no such key for shape \"dot\" (only for line), got 4\n"
            "d: $.width: expected an integer 1..3, got 4\n"
            "d: $.range: expected note beside it, got none\n"
            "d: $.nots: expected the key \"note\" or none, got an unknown key");
  EXPECT_EQ(read_again(R"({"format": "drawn", "version": 1, "shape": "line"})"),
            "d: $.length: expected a number 0..9, got nothing");
  // Of a kind that is none, no key is out of place; of another document, none is unknown.
  EXPECT_EQ(read_again(R"({"format": "drawn", "version": 1, "shape": "lin", "length": 4})"),
            R"(d: $.shape: expected "dot" or "line", got "lin")");
  EXPECT_EQ(read_again(R"({"format": "other", "version": 1, "depth": 4})"),
            R"(d: $.format: expected "drawn", got "other")");
}

TEST(Fields, AreThoseThatARowTakes) {
  EXPECT_EQ(read_again(R"({"shape": "line", "length": 4, "width": 3})", list_by_rows),
            R"({"shape":"line","length":4.0,"width":3})");
  EXPECT_EQ(read_again(R"({"shape": "line", "note": "n", "width": 3})", list_by_rows),
            "d: $.length: expected a number 0..9, got nothing\n"
            "d: $.note: expected no such key for shape \"line\" (only for dot), got \"n\"");
  EXPECT_EQ(read_again(R"({"shape": "dot", "note": "n", "width": 3})", list_by_rows),
            "d: $.width: expected no such key together with note, which sets it, got 3");
  // Of a kind that is none, no key is missing either.
  EXPECT_EQ(read_again(R"({"shape": "lin"})", list_by_rows),
            R"(d: $.shape: expected "dot" or "line", got "lin")");
  EXPECT_EQ(json(objects(list_by_rows).schema(Drawn()).at("allOf")), json::parse(R"([
      {"not": {"required": ["note", "width"]}},
      {"if": {"properties": {"shape": {"enum": ["line"]}}},
       "then": {"required": ["length"]}, "else": {"properties": {"length": false}}},
      {"if": {"properties": {"shape": {"enum": ["dot"]}}},
       "else": {"properties": {"note": false}}}])"));
}

TEST(Fields, AreDescribed) {
  EXPECT_EQ(json(objects(list_drawn).schema(Drawn())), json::parse(R"({
    "type": "object", "additionalProperties": false, "required": ["format", "version"],
    "properties": {
      "format": {"const": "drawn", "description": "Says what kind of document it is."},
      "version": {"const": 1, "description": "Version of the document's format."},
      "shape": {"enum": ["dot", "line"], "default": "dot", "description": "What it is."},
      "length": {"type": "number", "minimum": 0, "maximum": 9, "default": 2.5,
                 "description": "line: how long it is. Required."},
      "width": {"type": "integer", "minimum": 1, "maximum": 3, "default": 1, "description": "How wide."},
      "note": {"type": "string", "description": "For people."},
      "range": {"anyOf": [{"type": "number", "minimum": 0, "maximum": 1},
                          {"type": "array", "minItems": 2, "maxItems": 2,
                           "items": {"type": "number", "minimum": 0, "maximum": 1}}],
                "description": "Where."}},
    "dependencies": {"range": ["note"]},
    "allOf": [
      {"properties": {"width": {"maximum": 2}}},
      {"if": {"required": ["shape"], "properties": {"shape": {"enum": ["line"]}}},
       "then": {"required": ["length"]}, "else": {"properties": {"length": false}}}]})"));
}

}  // namespace
}  // namespace eventgan

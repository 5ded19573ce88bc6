#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "stages/shards/shard_tables.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// numpy's names of the types of a column's elements, and two that are no arrays of numbers.
template <class Element>
std::string dtype_of() {
  if constexpr (std::is_same_v<Element, std::string>) {
    return "str";
  } else if constexpr (std::is_same_v<Element, std::vector<char>>) {
    return "bytes";
  } else if constexpr (std::is_same_v<Element, Half>) {
    return "float16";
  } else {
    const std::string kind = std::is_floating_point_v<Element> ? "float"
                             : std::is_unsigned_v<Element>     ? "uint"
                                                               : "int";
    return kind + std::to_string(8 * sizeof(Element));
  }
}

/// The page's table of columns. Lengths that differ from shard to shard are read as the page names
/// them: a header in which each of them is a number of its own gives them.
std::string columns_table() {
  ShardHeader header;
  header.volume = {.bins = 50, .size = {204, 206}};
  header.tile_px = 2;
  header.label_schema.joint_names.resize(101);
  const std::map<std::size_t, std::string> lengths = {{100, "2B"}, {204, "H"},  {206, "W"},
                                                      {102, "TR"}, {103, "TC"}, {101, "J"}};
  const std::map<Rows, std::string> rows = {
      {Rows::kSamples, "N"}, {Rows::kOffsets, "N+1"}, {Rows::kBoxes, "R"}, {Rows::kPersons, "P"}};
  std::string table = "| column | meaning |\n|---|---|\n";
  const auto add = [&](const ColumnSpec& spec, const std::string& dtype) {
    std::string shape = rows.at(spec.rows);
    for (const std::size_t length : spec.inner) {
      const auto named = lengths.find(length);
      shape += "," + (named == lengths.end() ? std::to_string(length) : named->second);
    }
    table += "| `" + std::string(spec.path) + "` " + dtype + "[" + shape + "] | ";
    if (spec.optional()) table += "*" + std::string(spec.feature) + "*. ";
    table += std::string(spec.meaning) + " |\n";
  };
  add(volume_column(header.volume), "float16");
  const ShardTables none;
  visit_columns(none, header,
                [&]<class Element>(const ColumnSpec& spec, const std::vector<Element>&) {
                  add(spec, dtype_of<Element>());
                });
  return table;
}

TEST(ShardFormatPage, HasTheTableOfTheColumns) {
  const auto path =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "guides" / "shard_format.md";
  std::string page = testing::read_file(path);
  const std::string begin = "<!-- columns, made by eventgan_shards_test -->\n\n";
  const std::size_t mark = page.find(begin), end = page.find("\n<!-- end of columns -->\n");
  ASSERT_LT(mark, end);
  ASSERT_NE(end, page.npos);
  const std::size_t at = mark + begin.size();
  EXPECT_TRUE(testing::is_as_made(path, page.replace(at, end - at, columns_table())))
      << path << " is not what shard_tables.h says; EVENTGAN_WRITE_MADE_FILES=1 writes it";
}

}  // namespace
}  // namespace eventgan

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "manifests/job_words_internal.h"
#include "tests/manifests/manifest_cases.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using nlohmann::json;
using valijson::adapters::NlohmannJsonAdapter;

const json& schema_document() {
  static const json document = json::parse(testing::read_file(
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "manifest.schema.json"));
  return document;
}

bool schema_accepts(const json& document) {
  static const valijson::Schema& schema = *[] {
    auto* parsed = new valijson::Schema;
    valijson::SchemaParser(valijson::SchemaParser::kDraft7)
        .populateSchema(NlohmannJsonAdapter(schema_document()), *parsed);
    return parsed;
  }();
  // 9.0 and "9" are no integers here, as in the program.
  valijson::Validator validator(valijson::Validator::kStrongTypes);
  return validator.validate(schema, NlohmannJsonAdapter(document), nullptr);
}

TEST(ManifestSchema, AcceptsAndRejectsWhatTheProgramDoes) {
  // The other test of this table holds the program to `faults`.
  for (const testing::ManifestCase& c : testing::manifest_cases()) {
    const json document = json::parse(testing::manifest_text(c));
    EXPECT_EQ(schema_accepts(document), c.faults.empty() || c.beyond_schema) << c.name;
  }
}

TEST(ManifestSchema, LeavesOnlyTheSizeOfVolumesToTheProgram) {
  // Double keys and the text's encoding, too, but of these a parsed document shows nothing.
  std::vector<std::string> beyond;
  for (const testing::ManifestCase& c : testing::manifest_cases()) {
    if (c.beyond_schema) beyond.push_back(c.name);
  }
  EXPECT_THAT(beyond, ::testing::ElementsAre("volumes of 4 GiB"));
}

template <class T, std::size_t N>
json words(const std::array<Word<T>, N>& table) {
  json list = json::array();
  for (const Word<T>& entry : table) list.push_back(entry.word);
  return list;
}

TEST(ManifestSchema, ListsTheSameWords) {
  const auto listed = [](const char* pointer) {
    return schema_document().at(json::json_pointer(std::string(pointer) + "/enum"));
  };
  EXPECT_EQ(listed("/definitions/source/properties/dataset"), words(kDatasetWords));
  EXPECT_EQ(listed("/definitions/source/properties/layout"), words(kLayoutWords));
  EXPECT_EQ(listed("/definitions/pairs/properties/side"), words(kSideWords));
  EXPECT_EQ(listed("/definitions/pairs/properties/choose"), words(kChoiceWords));
  EXPECT_EQ(listed("/definitions/image/properties/fit"), words(kFitWords));
  EXPECT_EQ(listed("/definitions/image/properties/grey"), words(kGreyWords));
  EXPECT_EQ(listed("/properties/volume/properties/normalize"), words(kNormalizationWords));
  EXPECT_EQ(listed("/properties/output/properties/dtype"), words(kStoredTypeWords));
  EXPECT_EQ(listed("/properties/errors/properties/policy"), words(kPolicyWords));
}

TEST(ManifestSchema, StatesTheDefaultsOfTheProgram) {
  const auto stated = [](const char* pointer) {
    return schema_document().at(json::json_pointer(std::string(pointer) + "/default"));
  };
  const JobManifest manifest;
  const SourceSpec source;
  EXPECT_EQ(stated("/properties/seed"), manifest.seed);
  EXPECT_EQ(stated("/definitions/source/properties/split"), source.split);
  EXPECT_EQ(stated("/definitions/pairs/properties/side"), to_string(source.pairs.side));
  EXPECT_EQ(stated("/definitions/pairs/properties/choose"), to_string(source.pairs.choose));
  EXPECT_EQ(stated("/definitions/pairs/properties/min_pairs"), source.pairs.min_pairs);
  EXPECT_EQ(stated("/definitions/image/properties/fit"), to_string(manifest.image.fit));
  EXPECT_EQ(stated("/properties/generator/properties/precision"), manifest.generator.precision);
  EXPECT_EQ(stated("/properties/volume/properties/bins"), manifest.volume.bins);
  EXPECT_EQ(stated("/properties/volume/properties/normalize"),
            to_string(manifest.volume.normalize));
  EXPECT_EQ(stated("/properties/output/properties/samples_per_shard"),
            manifest.output.samples_per_shard);
  EXPECT_EQ(stated("/properties/output/properties/dtype"), to_string(manifest.output.dtype));
  EXPECT_EQ(stated("/properties/output/properties/deflate_level"), manifest.output.deflate_level);
  EXPECT_EQ(stated("/properties/errors/properties/policy"), to_string(manifest.errors.policy));
  EXPECT_EQ(stated("/properties/errors/properties/max_count"), manifest.errors.max_count);
  EXPECT_EQ(stated("/properties/errors/properties/max_fraction"), manifest.errors.max_fraction);
}

/// Every object of the schema that has properties must be closed, and each property described.
void expect_closed_and_described(const json& node, const std::string& place) {
  if (node.is_object() && node.value("type", json()) == "object") {
    EXPECT_EQ(node.value("additionalProperties", json()), false) << place;
    for (const auto& [name, property] : node.at("properties").items()) {
      const bool is_told = property.contains("description") || property.contains("const") ||
                           property.contains("$ref");
      EXPECT_TRUE(is_told) << place << "/properties/" << name;
    }
  }
  if (!node.is_structured()) return;
  for (const auto& [key, child] : node.items()) {
    expect_closed_and_described(child, place + "/" + key);
  }
}

TEST(ManifestSchema, EveryObjectIsClosedAndEveryPropertyDescribed) {
  expect_closed_and_described(schema_document(), "#");
}

TEST(ManifestSchema, AcceptsTheExamples) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "examples")) {
    const bool allow_exceptions = true, ignore_comments = true;
    const json document =
        json::parse(testing::read_file(entry.path()), nullptr, allow_exceptions, ignore_comments);
    EXPECT_TRUE(schema_accepts(document)) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 6);
}

}  // namespace
}  // namespace eventgan

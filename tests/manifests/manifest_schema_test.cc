#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/job_words_internal.h"
#include "manifests/sensor_spec.h"
#include "tests/manifests/json_schema.h"
#include "tests/manifests/manifest_cases.h"

namespace eventgan {
namespace {

using nlohmann::json;
constexpr char kSchema[] = "manifest.schema.json";

TEST(ManifestSchema, AcceptsAndRejectsWhatTheProgramDoes) {
  // The other test of this table holds the program to `faults`.
  for (const testing::ManifestCase& c : testing::manifest_cases()) {
    const json document = json::parse(testing::manifest_text(c));
    EXPECT_EQ(testing::schema_accepts(kSchema, document), c.faults.empty() || c.beyond_schema)
        << c.name;
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
    return testing::schema_document(kSchema).at(json::json_pointer(std::string(pointer) + "/enum"));
  };
  EXPECT_EQ(listed("/definitions/source/properties/dataset"), words(kDatasetWords));
  EXPECT_EQ(listed("/definitions/source/properties/layout"), words(kLayoutWords));
  EXPECT_EQ(listed("/definitions/pairs/properties/side"), words(kSideWords));
  EXPECT_EQ(listed("/definitions/pairs/properties/choose"), words(kChoiceWords));
  EXPECT_EQ(listed("/definitions/image/properties/fit"), words(kFitWords));
  EXPECT_EQ(listed("/definitions/image/properties/grey"), words(kGreyWords));
  EXPECT_EQ(listed("/properties/generator/properties/kind"), words(kGeneratorWords));
  EXPECT_EQ(listed("/properties/generator/properties/engine"), words(kEngineWords));
  EXPECT_EQ(listed("/properties/generator/properties/precision"), words(kPrecisionWords));
  EXPECT_EQ(listed("/properties/volume/properties/normalize"), words(kNormalizationWords));
  EXPECT_EQ(listed("/properties/output/properties/dtype"), words(kStoredTypeWords));
  EXPECT_EQ(listed("/properties/errors/properties/policy"), words(kPolicyWords));
}

TEST(ManifestSchema, StatesTheDefaultsOfTheProgram) {
  const auto stated = [](const char* pointer) { return testing::stated_default(kSchema, pointer); };
  const JobManifest manifest;
  const SourceSpec source;
  EXPECT_EQ(stated("/properties/seed"), manifest.seed);
  EXPECT_EQ(stated("/definitions/source/properties/split"), source.split);
  EXPECT_EQ(stated("/definitions/pairs/properties/side"), to_string(source.pairs.side));
  EXPECT_EQ(stated("/definitions/pairs/properties/choose"), to_string(source.pairs.choose));
  EXPECT_EQ(stated("/definitions/pairs/properties/min_pairs"), source.pairs.min_pairs);
  EXPECT_EQ(stated("/definitions/image/properties/fit"), to_string(manifest.image.fit));
  const GeneratorSpec& generator = manifest.generator;
  EXPECT_EQ(stated("/properties/generator/properties/kind"), to_string(generator.kind));
  EXPECT_EQ(stated("/properties/generator/properties/weights"), generator.weights);
  EXPECT_EQ(stated("/properties/generator/properties/precision"), to_string(generator.precision));
  EXPECT_EQ(stated("/properties/generator/properties/engine"),
            word_of(kEngineWords, generator.engine));
  EXPECT_EQ(stated("/properties/generator/properties/duration_s"), generator.duration_s);
  EXPECT_EQ(stated("/properties/generator/properties/max_displacement_px"),
            generator.max_displacement_px);
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

TEST(ManifestSchema, EveryObjectIsClosedAndEveryPropertyDescribed) {
  EXPECT_EQ(testing::open_or_undescribed(kSchema), "");
}

TEST(SensorSchema, IsTheSameInBothManifestsAndStatesTheDefaults) {
  const json& sensor = testing::schema_document(kSchema).at("definitions").at("sensor");
  EXPECT_EQ(sensor,
            testing::schema_document("simulation.schema.json").at("definitions").at("sensor"));
  json defaults;
  for (const auto& [key, property] : sensor.at("properties").items()) {
    defaults[key] = property.at("default").get<double>();
  }
  EXPECT_EQ(defaults, json::parse(to_json(SensorSpec())));
}

}  // namespace
}  // namespace eventgan

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/manifest_fields.h"
#include "manifests/documents/simulation_manifest.h"
#include "manifests/documents/training_manifest.h"
#include "manifests/values/events.h"
#include "manifests/values/words.h"
#include "tests/manifests/documents/json_schema.h"
#include "tests/manifests/documents/manifest_cases.h"

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

TEST(ManifestSchema, LeavesOnlyTheOrderOfARangeAndTheSizeOfVolumesToTheProgram) {
  // Double keys and the text's encoding, too, but of these a parsed document shows nothing.
  std::vector<std::string> beyond;
  for (const testing::ManifestCase& c : testing::manifest_cases()) {
    if (c.beyond_schema) beyond.push_back(c.name);
  }
  EXPECT_THAT(beyond,
              ::testing::ElementsAre("a range the wrong way round", "a range without values in it",
                                     "volumes of 4 GiB", "thresholds from more to less",
                                     "noise from more to less"));
}

TEST(ManifestSchema, StatesTheDefaultsOfTheProgram) {
  const auto stated = [](const char* pointer) { return testing::stated_default(kSchema, pointer); };
  const JobManifest manifest;
  const SourceSpec source;
  EXPECT_EQ(stated("/properties/seed"), manifest.seed);
  EXPECT_EQ(stated("/properties/sources/items/properties/split"), source.split);
  EXPECT_EQ(stated("/properties/sources/items/properties/every"), source.every);
  const std::string columns = "/properties/sources/items/properties/columns/properties/";
  const EventFields& fields = source.recording.columns;
  EXPECT_EQ(stated((columns + "t").c_str()), fields.t);
  EXPECT_EQ(stated((columns + "x").c_str()), fields.x);
  EXPECT_EQ(stated((columns + "y").c_str()), fields.y);
  EXPECT_EQ(stated((columns + "p").c_str()), fields.p);
  EXPECT_EQ(stated("/properties/sources/items/properties/camera"), source.recording.camera);
  EXPECT_EQ(stated("/properties/sources/items/properties/rectify"), source.recording.rectify);
  EXPECT_EQ(stated("/properties/sources/items/properties/pairs/properties/side"),
            to_string(source.pairs.side));
  EXPECT_EQ(stated("/properties/sources/items/properties/pairs/properties/choose"),
            to_string(source.pairs.choose));
  EXPECT_EQ(stated("/properties/sources/items/properties/pairs/properties/min_pairs"),
            source.pairs.min_pairs);
  EXPECT_EQ(stated("/properties/sources/items/properties/pairs/properties/from"),
            word_of(kPairOriginWords, source.pairs.stills.has_value()));
  const StillsSpec stills;
  const std::string motion =
      "/properties/sources/items/properties/pairs/properties/motion/properties/";
  EXPECT_EQ(stated((motion + "translation_px").c_str()), json(stills.translation_px));
  EXPECT_EQ(stated((motion + "rotation_deg").c_str()), stills.rotation_deg);
  EXPECT_EQ(stated((motion + "scale").c_str()), stills.scale);
  EXPECT_EQ(stated((motion + "frames").c_str()), stills.frames);
  const ObjectMotionSpec objects;
  const std::string of_objects = motion + "objects/properties/";
  EXPECT_EQ(stated((of_objects + "translation_px").c_str()), json(objects.translation_px));
  EXPECT_EQ(stated((of_objects + "rotation_deg").c_str()), objects.rotation_deg);
  EXPECT_EQ(stated((of_objects + "scale").c_str()), objects.scale);
  EXPECT_EQ(stated((of_objects + "rests").c_str()), objects.rests);
  EXPECT_EQ(stated("/properties/image/properties/fit"), to_string(manifest.image.fit));
  const GeneratorSpec& generator = manifest.generator;
  EXPECT_EQ(stated("/properties/generator/properties/kind"), to_string(generator.kind));
  EXPECT_EQ(stated("/properties/generator/properties/weights"), generator.weights);
  EXPECT_EQ(stated("/properties/generator/properties/precision"),
            word_of(kPrecisionChoiceWords, generator.precision));
  EXPECT_EQ(stated("/properties/generator/properties/engine"),
            word_of(kEngineWords, generator.engine));
  EXPECT_EQ(stated("/properties/generator/properties/device"), to_string(generator.device));
  EXPECT_EQ(stated("/properties/generator/properties/scope"), to_string(generator.scope.scope));
  EXPECT_EQ(stated("/properties/generator/properties/motion_threshold"),
            generator.scope.motion_threshold);
  EXPECT_EQ(stated("/properties/generator/properties/motion_margin_px"),
            generator.scope.motion_margin_px);
  EXPECT_EQ(stated("/properties/generator/properties/label_margin_px"),
            generator.scope.label_margin_px);
  EXPECT_EQ(stated("/properties/generator/properties/tile_px"), generator.scope.tile_px);
  EXPECT_EQ(stated("/properties/generator/properties/sample"), generator.sample);
  EXPECT_EQ(stated("/properties/generator/properties/sensor/anyOf/2/properties/threshold_ratio"),
            ThresholdSpec().ratio);
  EXPECT_EQ(stated("/properties/generator/properties/duration_s"), generator.duration_s);
  EXPECT_EQ(stated("/properties/generator/properties/max_displacement_px"),
            generator.max_displacement_px);
  EXPECT_EQ(stated("/properties/volume/properties/bins"), manifest.volume.bins);
  EXPECT_EQ(stated("/properties/volume/properties/normalize"),
            to_string(manifest.volume.normalize));
  EXPECT_EQ(stated("/properties/output/properties/dtype"), to_string(manifest.output.dtype));
  EXPECT_EQ(stated("/properties/output/properties/deflate_level"), manifest.output.deflate_level);
  EXPECT_EQ(stated("/properties/errors/properties/policy"), to_string(manifest.errors.policy));
  EXPECT_EQ(stated("/properties/errors/properties/max_count"), manifest.errors.max_count);
  EXPECT_EQ(stated("/properties/errors/properties/max_fraction"), manifest.errors.max_fraction);
}

TEST(ManifestSchema, EveryObjectIsClosedAndEveryPropertyDescribed) {
  EXPECT_EQ(testing::open_or_undescribed(kSchema), "");
}

TEST(SensorSchema, StatesTheDefaults) {
  const json& sensor =
      testing::schema_document("simulation.schema.json").at("properties").at("sensor");
  json defaults;
  for (const auto& [key, property] : sensor.at("properties").items()) {
    defaults[key] = property.at("default").get<double>();
  }
  EXPECT_EQ(defaults, json::parse(to_json(SensorSpec())));
}

std::filesystem::path examples() {
  return std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "examples";
}

JobManifest example(const std::string& name) { return read_job_manifest(examples() / name); }

TEST(ManifestExamples, AllAreSoundAndMatchTheirSchemas) {
  const std::map<std::string, std::string> schemas = {
      {"eventgan-manifest", "manifest.schema.json"},
      {"eventgan-simulation", "simulation.schema.json"},
      {"eventgan-training", "training.schema.json"}};
  std::map<std::string, int> counts;
  for (const auto& entry : std::filesystem::directory_iterator(examples())) {
    const nlohmann::json document = testing::read_commented_json(entry.path());
    const std::string format = document.at("format");
    ++counts[format];
    EXPECT_TRUE(testing::schema_accepts(schemas.at(format), document)) << entry.path();
    if (format == "eventgan-simulation") {
      EXPECT_NO_THROW(read_simulation_manifest(entry.path())) << entry.path();
    } else if (format == "eventgan-training") {
      EXPECT_NO_THROW(read_training_manifest(entry.path())) << entry.path();
    } else {
      EXPECT_NO_THROW(read_job_manifest(entry.path())) << entry.path();
    }
  }
  EXPECT_EQ(counts.size(), schemas.size());
  EXPECT_GE(counts["eventgan-manifest"], 6);
}

TEST(ManifestExamples, SayWhatTheirNamesSay) {
  EXPECT_EQ(example("kitti.json").sources.at(0).dataset, DatasetKind::kKittiObject);
  EXPECT_EQ(example("kitti_raw_gaps.json").sources.at(0).pairs.gaps.size(), 6u);
  EXPECT_EQ(example("mpii.json").sources.at(0).pairs.side, PairSide::kAround);
  EXPECT_EQ(example("human36m.json").sources.at(0).layout, Human36mLayout::kOfficial);
  EXPECT_EQ(example("frames.json").image.size, std::nullopt);
  EXPECT_EQ(example("all.json").sources.size(), 4u);
}

}  // namespace
}  // namespace eventgan

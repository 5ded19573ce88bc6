#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/document_schemas.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/documents/manifest_fields.h"
#include "manifests/documents/simulation_manifest.h"
#include "manifests/documents/training_manifest.h"
#include "tests/manifests/documents/json_schema.h"
#include "tests/manifests/documents/manifest_cases.h"

namespace eventgan {
namespace {

using nlohmann::json;

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

/// A document of all keys that `list` tells, and what it writes of what it reads.
struct Written {
  template <class T>
  Written(std::string file, const char* text, void (*list)(Fields&, T&))
      : schema(std::move(file)), given(json::parse(text)) {
    FaultList faults("d");
    T document;
    objects(list).read(StrictValue(given, faults), document);
    EXPECT_EQ(faults.text(), "");
    written = objects(list).json(document);
  }
  std::string schema;
  json given, written;
};

std::vector<Written> written_documents() {
  constexpr char kJob[] = "manifest.schema.json", kTraining[] = "training.schema.json";
  return {{kJob, R"({
    "format": "eventgan-manifest", "version": 1, "name": "n", "seed": 9223372036854775807,
    "sources": [
      {"dataset": "kitti_object", "root": "a", "split": "val", "raw_root": "b", "devkit": "c",
       "outlines": "m", "ids": "i", "classes": ["Car"], "fraction": [0.25, 0.5],
       "pairs": {"from": "sequence", "gaps": [1, 4, 6], "side": "after", "choose": "all",
                 "min_pairs": 5, "max_gap_s": 0.4}},
      {"dataset": "mpii", "root": "d", "annotations": "e", "sequences": "f",
       "pairs": {"gaps": [4], "side": "around"}},
      {"dataset": "human36m", "root": "g", "layout": "official", "every": 5, "subjects": ["S1"],
       "cameras": ["2"], "actions": ["Eating"], "pairs": {"gaps": [2]}},
      {"dataset": "frames", "root": "h", "frames_per_second": 29.97,
       "labels": {"format": "voc", "path": "i", "edges_from": 0}, "flow": true,
       "pairs": {"from": "stills", "frames": 7,
                 "motion": {"translation_px": [1, 2], "rotation_deg": 3, "scale": 0.25, "frames": 2,
                            "rests": 0.75,
                            "objects": {"translation_px": [3, 4], "rotation_deg": 5, "scale": 0.125,
                                        "rests": 0.5}}}}],
    "image": {"width": 861, "height": 260, "fit": "crop", "grey": "after_resize", "blur": 5,
              "range": [7000, 9000.5]},
    "generator": {"kind": "network", "weights": "untrained:8", "engine": "onednn", "device": "cuda",
                  "precision": "int8", "sample": false, "scope": "labels", "motion_threshold": 2.5,
                  "motion_margin_px": 0, "label_margin_px": 100, "tile_px": 32, "sensor": {}},
    "volume": {"bins": 3, "normalize": "eta98"},
    "output": {"directory": "o", "samples_per_shard": 7, "dtype": "uint8", "deflate_level": 9},
    "errors": {"policy": "fail", "max_count": 3, "max_fraction": 0.5}})",
           list_job},
          {kJob, R"({
    "format": "eventgan-manifest", "version": 1, "name": "n", "sources": [
      {"dataset": "recording", "root": "r", "camera": "right", "rectify": true,
       "sensor": {"height": 260, "width": 346}, "stream": 3, "time_shift": false,
       "columns": {"t": "a", "x": "b", "y": "c", "p": "d", "unit": "ns"}, "window_s": 0.5,
       "label_at": "middle"},
      {"dataset": "recording", "root": "s"},
      {"dataset": "dhp19", "root": "d", "without_actions": ["2_1"], "window_events": 5}],
    "image": {}, "generator": {"kind": "events"}, "output": {"directory": "o"}})",
           list_job},
          {kJob, R"({
    "format": "eventgan-manifest", "version": 1, "name": "n",
    "sources": [{"dataset": "frames", "root": "r", "pairs": {"gaps": [1]}},
                {"dataset": "frames", "root": "r", "pairs": {"from": "stills", "motion": {"objects": {}}}}],
    "image": {"preset": "kitti"}, "generator": {"kind": "esim", "duration_s": 0.03, "max_displacement_px": 4},
    "output": {"directory": "o"}})",
           list_job},
          {kTraining, R"({
    "format": "eventgan-training", "version": 1, "name": "n", "seed": 9,
    "recordings": [{"path": "a", "format": "mvsec", "camera": "right", "weight": 2.5,
                    "first_frame": 3, "last_frame": 8},
                   {"path": "b", "format": "dsec", "rectify": true}],
    "validation": [{"path": "c", "format": "eventgan"}],
    "gaps": [1, 3], "crop": {"width": 96, "height": 64}, "batch": 4,
    "network": {"generator_channels": 8, "discriminator_channels": 16, "cycle_channels": 4,
                "spectral_norm": "encoders", "output_slope": 0.25, "difference_gain": 6, "bins": 5,
                "sensor": false},
    "losses": {"adversarial": 0.5, "flow": 2, "reconstruction": 3, "volume": 4, "count": 6,
               "overlap": 7, "quantile": 0.7, "smoothness": 5},
    "label_flip": 0.2, "discriminator_steps": 3,
    "augmentation": {"flip": false, "gain": [0.5, 2], "gamma": [0.8, 1.25],
                     "reverse": true, "static_fraction": 0.1, "event_fraction": 0.3},
    "optimizer": {"generator_rate": 1e-3, "cycle_rate": 2e-3, "discriminator_rate": 3e-3,
                  "betas": [0.5, 0.9], "final_rate_fraction": 0.01},
    "precision": "bfloat16", "steps": {"flow": 1, "reconstruction": 2, "generator": 3},
    "output": {"directory": "o", "checkpoint_minutes": 0, "image_minutes": 0.5}})",
           list_training},
          {kTraining, R"({
    "format": "eventgan-training", "version": 1, "name": "n",
    "recordings": [{"path": "a", "format": "ecd", "threshold": 0.4, "threshold_ratio": 1.5}],
    "network": {"sensor": true}, "teacher": "w.safetensors",
    "losses": {"adversarial": 0, "flow": 0, "reconstruction": 0, "likelihood": 1,
               "block_likelihood": 0.25},
    "simulated": {"textures": ["t/a", "b"], "fraction": 0.75}, "steps": {"generator": 3},
    "output": {"directory": "o"}})",
           list_training},
          {kTraining, R"({
    "format": "eventgan-training", "version": 1, "name": "n",
    "recordings": [{"path": "a", "format": "ecd"}], "steps": {"flow": 1, "reconstruction": 1},
    "output": {"directory": "o"}})",
           list_training},
          {"simulation.schema.json", R"({
    "format": "eventgan-simulation", "version": 1, "name": "n", "seed": 9,
    "sources": [
      {"path": "q", "name": "q", "method": "affine", "frames_per_second": 29.97, "first_frame": 3,
       "frame_count": 4, "frame_step": 5, "frames_per_image": 6, "max_displacement_px": 7.5},
      {"path": "r", "name": "r"}, {"path": "s", "name": "s", "method": "affine"}],
    "size": {"width": 346, "height": 260},
    "sensor": {"positive_threshold": 0.5, "negative_threshold": 0.25, "threshold_spread": 0.125,
               "refractory_s": 0.01, "leak_rate_hz": 2, "shot_noise_rate_hz": 3,
               "hot_pixel_fraction": 0.5, "hot_pixel_rate_hz": 4, "log_epsilon": 0.02},
    "output": {"directory": "o", "format": "aedat4"}})",
           list_simulation}};
}

/// Keys whose values are kept as other members, of which the tests of the documents tell.
bool is_kept_otherwise(const std::string& pointer) {
  for (const char* part : {"/image/", "/generator/sensor", "/threshold"}) {
    if (pointer.find(part) != pointer.npos) return true;
  }
  return false;
}

/// What an object may hold that can also be a word.
const json& object_of(const json& schema) {
  return schema.contains("anyOf") && schema.at("anyOf").back().contains("properties")
             ? schema.at("anyOf").back()
             : schema;
}

/// Each value that was written is the one that was given, or else the default that the schema says.
void expect_given_or_default(const json& schema, const json& given, const json& written) {
  for (const auto& [key, value] : written.items()) {
    const json& property = schema.at("properties").at(key);
    const bool has_objects = value.is_array() && property.at("items").contains("properties");
    const bool has_default = !given.contains(key) && property.contains("default");
    if (is_kept_otherwise("/" + key)) continue;
    if (value.is_object() && !has_default) {
      expect_given_or_default(object_of(property), given.value(key, json::object()), value);
    } else if (has_objects) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        expect_given_or_default(property.at("items"), given.at(key).at(i), value.at(i));
      }
    } else {
      EXPECT_EQ(value, given.value(key, property.value("default", json()))) << key;
    }
  }
}

void add_keys(const json& value, const std::string& place, std::set<std::string>& keys) {
  if (!value.is_structured()) return;
  for (const auto& [key, member] : value.items()) {
    const std::string at = value.is_object() ? place + "/" + key : place;
    if (value.is_object()) keys.insert(at);
    add_keys(member, at, keys);
  }
}

void add_schema_keys(const json& schema, const std::string& place, std::set<std::string>& keys) {
  const json properties = schema.value("properties", json::object());
  for (const auto& [key, property] : properties.items()) {
    keys.insert(place + "/" + key);
    // The table of recordings, and a sensor's document.
    if (key == "validation" || is_kept_otherwise(place + "/" + key)) continue;
    add_schema_keys(property.value("items", object_of(property)), place + "/" + key, keys);
  }
}

TEST(Documents, HoldEveryValueGivenAndElseTheDefaultsOfTheSchema) {
  std::map<std::string, std::set<std::string>> given_keys;
  for (const Written& one : written_documents()) {
    SCOPED_TRACE(one.given.dump());
    expect_given_or_default(testing::schema_document(one.schema), one.given, one.written);
    const json flat = one.written.flatten(), given = one.given.flatten();
    for (const auto& [pointer, value] : given.items()) {
      EXPECT_TRUE(flat.contains(pointer) || value.is_null() || is_kept_otherwise(pointer))
          << pointer;
    }
    add_keys(one.given, "", given_keys[one.schema]);
  }
  for (const auto& [schema, given] : given_keys) {
    std::set<std::string> all;
    add_schema_keys(testing::schema_document(schema), "", all);
    for (const std::string& key : all) EXPECT_TRUE(given.contains(key)) << schema << key;
  }
}

TEST(Documents, HaveSchemasWhoseObjectsAreClosedAndWhosePropertiesAreDescribed) {
  for (const auto& [name, schema] : document_schemas()) {
    EXPECT_EQ(testing::open_or_undescribed(name), "") << name;
  }
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

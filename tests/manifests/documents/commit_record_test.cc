#include "manifests/documents/commit_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

CommitRecord sample_commit_record() {
  return {
      .shard = "events-train-00000-of-00001.h5",
      .plan_hash = std::string(64, 'a'),
      .sha256 = std::string(64, '0'),
      .size_bytes = 5'000'000'000,
      .samples = 4,
      .valid = 2,
      .quarantined = {{1, "000001", "expected a PNG, got 0 bytes, in a \"b\".png"}, {3, "", ""}},
      .contents = {.boxes = {2, 0, 1, 0},
                   .persons = {0, 0, 0, 0},
                   .classes = {{"Car", 2}, {"DontCare", 1}},
                   .gaps = {{1, 3}, {6, 1}},
                   .optional_columns = {"/labels/boxes/alpha"}},
      .stage_seconds = {{"write", 0.1}, {"decode", 1.5}},
      .wall_seconds = 2.25,
      .peak_bytes = 600'000'000};
}

TEST(CommitRecord, TextIsCanonical) {
  EXPECT_EQ(to_json(sample_commit_record()), R"({
  "boxes": [2,0,1,0],
  "classes": {
    "Car": 2,
    "DontCare": 1
  },
  "format": "eventgan-commit-record",
  "gaps": [
    {
      "gap": 1,
      "samples": 3
    },
    {
      "gap": 6,
      "samples": 1
    }
  ],
  "optional_columns": [
    "/labels/boxes/alpha"
  ],
  "peak_bytes": 600000000,
  "persons": [0,0,0,0],
  "plan_hash": ")" + std::string(64, 'a') +
                                                 R"(",
  "quarantined": [
    {
      "reason": "expected a PNG, got 0 bytes, in a \"b\".png",
      "sample_id": "000001",
      "slot": 1
    },
    {
      "reason": "",
      "sample_id": "",
      "slot": 3
    }
  ],
  "samples": 4,
  "sha256": ")" + std::string(64, '0') + R"(",
  "shard": "events-train-00000-of-00001.h5",
  "size_bytes": 5000000000,
  "stage_seconds": {
    "decode": 1.5,
    "write": 0.1
  },
  "valid": 2,
  "version": "1.0",
  "wall_seconds": 2.25
}
)");
}

TEST(CommitRecord, GoesThereAndBack) {
  CommitRecord record = sample_commit_record();
  EXPECT_EQ(parse_commit_record(to_json(record), "m"), record);
  record.inputs = {.losses = {.boxes = {4, {"a\nb", "c", "d"}},
                              .outlines = {1, {"e"}},
                              .tracks = {},
                              .of_other_classes = 5},
                   .same_images = 2,
                   .empty_volumes = 1,
                   .outlines = {120, 300, 12}};
  EXPECT_EQ(parse_commit_record(to_json(record), "m"), record);
  record.inputs = {};
  record.quarantined = {};
  record.valid = record.samples = 0;
  record.contents.boxes = record.contents.persons = {};
  record.contents.classes = {};
  record.contents.gaps = {};
  record.contents.optional_columns = {};
  record.stage_seconds = {};
  EXPECT_EQ(parse_commit_record(to_json(record), "m"), record);
  record.peak_bytes = 0;
  record.stage_seconds = {{"odd \"name\"", 1.0 / 3.0}, {"none", 0}, {"tiny", 5e-324}};
  EXPECT_EQ(parse_commit_record(to_json(record), "m"), record);
}

TEST(CommitRecord, ReasonsNeedNotBeUtf8) {
  CommitRecord record = sample_commit_record();
  record.quarantined[0].reason = std::string(
      "a\xff"
      "b\0c",
      5);  // as a path may be
  const CommitRecord back = parse_commit_record(to_json(record), "m");
  EXPECT_EQ(back.quarantined[0].reason, std::string("a\xef\xbf\xbd"
                                                    "b\0c",
                                                    7));  // U+FFFD
}

TEST(CommitRecord, SecondsMustBeNumbersThatJsonHas) {
  for (const double seconds : {std::nan(""), std::numeric_limits<double>::infinity(), -1.0}) {
    CommitRecord record = sample_commit_record();
    record.stage_seconds["write"] = seconds;
    EXPECT_THROWS(to_json(record), std::invalid_argument, "expected seconds of 0 or more");
    record = sample_commit_record();
    record.wall_seconds = seconds;
    EXPECT_THROWS(to_json(record), std::invalid_argument, "expected seconds of 0 or more");
  }
}

TEST(CommitRecord, RowCountsStandOnOneLineHoweverManyTheyAre) {
  CommitRecord record = sample_commit_record();
  record.samples = 65536;
  record.valid = record.samples - 2;
  record.contents.boxes.assign(65536, 2147483647);
  record.contents.persons.assign(65536, 0);
  record.contents.classes = {{"a\nname \"quoted\"", 1}};
  const std::string text = to_json(record);
  EXPECT_LT(std::count(text.begin(), text.end(), '\n'), 60);
  EXPECT_EQ(parse_commit_record(text, "m"), record);
}

TEST(CommitRecord, OfALaterMinorVersionNamesWhatIsNotKnown) {
  auto document = nlohmann::json::parse(to_json(sample_commit_record()));
  document["version"] = "1.7";
  document["host"] = "x";
  document["quarantined"][0]["frame"] = 3;
  const CommitRecord record = parse_commit_record(document.dump(), "m");
  EXPECT_THAT(record.unknown, ::testing::ElementsAre("$.host", "$.quarantined[].frame"));
  CommitRecord known = record;
  known.unknown = {};
  EXPECT_EQ(known, sample_commit_record());
}

struct BadCommitRecord {
  const char* pointer;
  const char* value;
  const char* fault;
};

TEST(CommitRecord, EveryRuleIsChecked) {
  const std::vector<BadCommitRecord> table = {
      {"/format", R"("eventgan-manifest")",
       R"($.format: expected "eventgan-commit-record", got "eventgan-manifest")"},
      {"/version", R"("2.0")",
       R"($.version: expected "1.0" (this program reads versions 1.x), got "2.0")"},
      {"/shard", R"("../job-train-00000-of-00001.h5")",
       "$.shard: expected a shard's name, such as job-train-00012-of-01024.h5, got "
       R"("../job-train-00000-of-00001.h5")"},
      {"/plan_hash", R"("")", R"($.plan_hash: expected a SHA-256 of 64 digits 0-9a-f, got "")"},
      {"/sha256", "7", "$.sha256: expected a SHA-256 of 64 digits 0-9a-f, got 7"},
      {"/size_bytes", "1.5", "$.size_bytes: expected an integer 0..9223372036854775807, got 1.5"},
      {"/samples", "65537", "$.samples: expected an integer 0..65536, got 65537"},
      {"/valid", "5", "$.valid: expected an integer 0..4, got 5"},
      {"/valid", "3", "$.valid: expected 2 (samples minus quarantined ones), got 3"},
      {"/quarantined/1/slot", "4", "$.quarantined[1].slot: expected an integer 0..3, got 4"},
      {"/quarantined/1/slot", "1",
       "$.quarantined[1].slot: expected slots in ascending order, got 1"},
      {"/quarantined/0/reason", "null", "$.quarantined[0].reason: expected text, got null"},
      {"/quarantined/0/slots", "1",
       R"($.quarantined[0].slots: expected the key "slot" or none, got an unknown key)"},
      {"/quarantined", "{}", "$.quarantined: expected an array, got an object"},
      {"/boxes/2", "-1", "$.boxes[2]: expected an integer 0..2147483647, got -1"},
      {"/boxes/3", "2147483648", "$.boxes[3]: expected an integer 0..2147483647, got 2147483648"},
      {"/boxes/4", "0",
       "$.boxes: expected an array of 4 (a number for each sample), got an array of 5"},
      {"/persons", "[0, 0, 0]",
       "$.persons: expected an array of 4 (a number for each sample), got an array of 3"},
      {"/persons", "null", "$.persons: expected an array, got null"},
      {"/classes/Car", "0", "$.classes.Car: expected an integer 1..9223372036854775807, got 0"},
      {"/gaps/0/gap", "7", "$.gaps[0].gap: expected an integer 0..6, got 7"},
      {"/gaps/1/gap", "1", "$.gaps[1].gap: expected gaps in ascending order, got 1"},
      {"/gaps/1/samples", "5", "$.gaps[1].samples: expected an integer 1..4, got 5"},
      {"/gaps/0/pairs", "1", "$.gaps[0].pairs: expected one of the keys gap, samples"},
      {"/optional_columns/0", "3", "$.optional_columns[0]: expected text, got 3"},
      {"/wall_seconds", "-0.5", "$.wall_seconds: expected a number 0..1e+12, got -0.5"},
      {"/peak_bytes", "-1", "$.peak_bytes: expected an integer 0..9223372036854775807, got -1"},
      {"/stage_seconds/write", "-1", "$.stage_seconds.write: expected a number 0..1e+12, got -1"},
      {"/stage_seconds", "[]", "$.stage_seconds: expected an object, got an array of 0"},
      {"/same_images", "5", "$.same_images: expected an integer 0..4, got 5"},
      {"/label_losses", "{}", "$.label_losses.boxes: expected an object, got nothing"},
      {"/label_losses", R"({"boxes": {"count": 1, "first": ["a", "b"]}})",
       "$.label_losses.boxes.first: expected an array of at most 1 (a reason each), got an array "
       "of 2"},
      {"/host", R"("x")",
       "$.host: expected one of the keys format, version, shard, plan_hash, sha256, size_bytes, "
       "samples, valid, quarantined, boxes, persons, classes, gaps, optional_columns, "
       "stage_seconds, wall_seconds, outlines, label_losses, same_images, empty_volumes, "
       "peak_bytes, got an unknown key"},
  };
  for (const BadCommitRecord& bad : table) {
    auto document = nlohmann::json::parse(to_json(sample_commit_record()));
    document[nlohmann::json::json_pointer(bad.pointer)] = nlohmann::json::parse(bad.value);
    const std::string text = document.dump();
    EXPECT_THROWS(parse_commit_record(text, "m"), std::runtime_error,
                  std::string("m: ") + bad.fault)
        << text;
  }
}

TEST(CommitRecord, EveryKeyButTheMemoryIsRequired) {
  const auto whole = nlohmann::json::parse(to_json(sample_commit_record()));
  for (const auto& [key, value] : whole.items()) {
    nlohmann::json document = whole;
    document.erase(key);
    if (key == "peak_bytes") {  // of commit records from before it was kept
      EXPECT_EQ(parse_commit_record(document.dump(), "m").peak_bytes, 0);
      continue;
    }
    EXPECT_THROWS(parse_commit_record(document.dump(), "m"), std::runtime_error,
                  "m: $." + key + ": expected");
  }
}

TEST(CommitRecord, AllFaultsAreReportedAtOnce) {
  auto document = nlohmann::json::parse(to_json(sample_commit_record()));
  document["valid"] = "x";
  document["sha256"] = "x";
  document.erase("shard");
  EXPECT_THROWS(
      parse_commit_record(document.dump(), "m"), std::runtime_error,
      ::testing::Eq("m: $.shard: expected a shard's name, such as job-train-00012-of-01024.h5, got "
                    "nothing\n"
                    "m: $.sha256: expected a SHA-256 of 64 digits 0-9a-f, got \"x\"\n"
                    "m: $.valid: expected an integer 0..4, got \"x\""));
}

TEST(CommitRecord, HalfAFileIsNoCommitRecord) {
  const std::string text = to_json(sample_commit_record());
  // Without the last line feed it is still whole.
  for (std::size_t size = 0; size + 1 < text.size(); ++size) {
    EXPECT_THROWS(parse_commit_record(text.substr(0, size), "m"), std::runtime_error,
                  ": expected JSON, got an error while parsing")
        << size;
  }
}

TEST(ShardName, IsWhatAPlanGivesAndNothingThatLeadsElsewhere) {
  const std::string end = "-00000-of-00001.h5";
  const std::string longest(64, 'a');
  for (const std::string& name :
       {"job-train" + end, "my-job-2-val.b" + end, longest + "-" + longest + end,
        std::string("job-train-123456-of-654321.h5"), "job-train-00000-of-00001" + end}) {
    EXPECT_TRUE(is_shard_name(name)) << name;
  }
  for (const std::string& name : {std::string(),
                                  end,
                                  "train" + end,
                                  "-train" + end,
                                  "job-" + end,
                                  ".job-train" + end,
                                  "../job-train" + end,
                                  "/job-train" + end,
                                  "a/job-train" + end,
                                  "job-train/" + end,
                                  "job-tr ain" + end,
                                  "job-tr\nain" + end,
                                  std::string("job\0-train", 10) + end,
                                  "job-train" + end + std::string(1, '\0'),
                                  longest + "a-train" + end,
                                  std::string("job-train-0000-of-00001.h5"),
                                  std::string("job-train-00000-of-0001.h5"),
                                  std::string("job-train-00000-00001.h5"),
                                  std::string("job-train-00000-of-00001.json"),
                                  std::string("job-train.h5"),
                                  std::string("dataset.h5"),
                                  std::string("mine.h5"),
                                  std::string("00000-of-00001.h5")}) {
    EXPECT_FALSE(is_shard_name(name)) << name;
  }
}

TEST(CommitRecord, IsNamedAfterItsShard) {
  EXPECT_EQ(commit_record_name("a-00000-of-00001.h5"), "a-00000-of-00001.json");
  EXPECT_EQ(commit_record_name("a.h5.h5"), "a.h5.json");
  EXPECT_THROWS(commit_record_name("a.json"), std::invalid_argument,
                "expected a shard name ending in .h5, got \"a.json\"");
  EXPECT_THROWS(commit_record_name(".h5"), std::invalid_argument,
                "expected a shard name ending in .h5, got \".h5\"");
}

}  // namespace
}  // namespace eventgan

#include "manifests/documents/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/manifests/documents/small_plan.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::small_plan;

TEST(PlanJson, RoundTripsByteForByte) {
  const std::string text = to_json(small_plan());
  const Plan back = parse_plan(text, "plan.json");
  EXPECT_EQ(to_json(back), text);
  EXPECT_EQ(back.sample_count(), 3);
  EXPECT_EQ(back.manifest_text, small_plan().manifest_text);
  const PlannedSample& sample = back.shards[0].samples[0];
  EXPECT_EQ(sample.pair.previous.path, "root/a \xc3\xa9.png");
  EXPECT_EQ(sample.pair.previous.time_s, 0.1);
  EXPECT_EQ(sample.pair.next.video_frame, 17);
  EXPECT_TRUE(std::isnan(sample.pair.next.time_s));
  EXPECT_EQ(sample.pair.label_position, 0.5);
  EXPECT_EQ(back.shards[0].samples[1].fault, "expected a frame, got no file, in x");
  EXPECT_EQ(back.sources[0].pairs_by_gap, (std::map<int, std::int64_t>{{1, 1}, {6, 1}}));
}

TEST(PlanJson, AShardOfUnknownSizeSaysSo) {
  Plan plan = small_plan();
  plan.shards[1].size_unknown = true;
  const std::string text = to_json(plan);
  EXPECT_THAT(text, HasSubstr("\n],\"size_unknown\":true,\"source\":1,\"width\":6}\n"));
  const Plan back = parse_plan(text, "plan.json");
  EXPECT_FALSE(back.shards[0].size_unknown);
  EXPECT_TRUE(back.shards[1].size_unknown);
  EXPECT_EQ(to_json(back), text);
}

TEST(PlanJson, AVideosFirstFrameIsStillOfAVideo) {
  Plan plan = small_plan();
  plan.shards[1].samples[0].pair.previous = {"clip.mp4", 0, 0};
  const FrameRef back = parse_plan(to_json(plan), "plan.json").shards[1].samples[0].pair.previous;
  EXPECT_EQ(back.video_frame, 0);
  EXPECT_EQ(back.index, 0);
}

TEST(PlanJson, AStillsMotionIsStoredToTheLastBit) {
  Plan plan = small_plan();
  const ImageMotion motion{1.0 / 3, -1e-17, 2 - 1e-15, 1 + 1e-15};
  plan.shards[1].samples[0].pair.motion = motion;
  const std::string text = to_json(plan);
  EXPECT_THAT(text, HasSubstr("\"motion\":{\"angle_deg\":1.999999999999999,\"scale\":"));
  const Plan back = parse_plan(text, "plan.json");
  EXPECT_EQ(back.shards[0].samples[0].pair.motion, std::nullopt);
  EXPECT_EQ(back.shards[1].samples[0].pair.motion, motion);
  EXPECT_EQ(to_json(back), text);
  const auto at = text.find("\"scale\":") + 8;
  const std::string zero = text.substr(0, at) + "0" + text.substr(text.find(',', at));
  EXPECT_THROWS(parse_plan(zero, "p"), std::runtime_error, "motion.scale: expected a number");
}

TEST(Notes, OfAllSourcesAndOfVeryManyTheFirst) {
  Plan plan = small_plan();
  EXPECT_EQ(notes_text({}), "");
  plan.sources[1].notes = {"another"};
  EXPECT_EQ(notes_of(plan.sources), (std::vector<std::string>{"a \"note\"", "another"}));
  EXPECT_EQ(notes_text(notes_of(plan.sources)),
            "2 notes on the inputs:\n  note: a \"note\"\n  note: another\n");
  const std::string many = notes_text(std::vector<std::string>(1000, "x"));
  EXPECT_THAT(many, HasSubstr("1000 notes on the inputs:\n  note: x\n"));
  EXPECT_THAT(many, HasSubstr("... and 995 more"));
  std::vector<std::string> losses(8, "x");
  for (const char* loss : {"1 box left out: a", "2 boxes left out: b"}) losses.emplace_back(loss);
  EXPECT_EQ(notes_text(losses),
            "10 notes on the inputs:\n  note: 1 box left out: a\n  note: 2 boxes left out: b\n"
            "  note: x\n  note: x\n  note: x\n  ... and 5 more (in plan.json)\n");
  EXPECT_THAT(notes_text(std::vector<std::string>(7, "1 box left out")), Not(HasSubstr("more")));
}

TEST(PlanJson, OfNoShardsRoundTrips) {
  const std::string text = to_json(Plan{});
  EXPECT_EQ(to_json(parse_plan(text, "plan.json")), text);
}

TEST(PlanJson, BytesAreAsTheyEverWere) {
  // Changing them would orphan every folder that was frozen before.
  EXPECT_EQ(to_json(small_plan()), R"({"format":"eventgan-plan","version":"1.0",
"fingerprint":{"manifest":"bb","weights":"aa"},
"manifest":"{ // a \"job\"\n}",
"name":"job",
"shards":[
{"height":3,"name":"job-train-00000-of-00002.h5","samples":[
{"gap":1,"id":"s1","label":"label#1","label_index":5,"label_position":0.5,"next":{"index":5,"path":"clip.mp4","video_frame":17},"previous":{"index":4,"path":"root/a é.png","time_s":0.1},"sequence":"seq"},
{"fault":"expected a frame, got no file, in x","gap":6,"id":"s2","label":"","label_index":-1,"label_position":1.0,"next":{"index":4,"path":"root/a é.png","time_s":0.1},"previous":{"index":5,"path":"clip.mp4","video_frame":17},"sequence":""}
],"source":0,"width":4},
{"height":5,"name":"job-train-00001-of-00002.h5","samples":[
{"gap":2,"id":"s3","label":"","label_index":7,"label_position":1.0,"next":{"index":7,"path":"b"},"previous":{"index":5,"path":"a"},"sequence":""}
],"source":1,"width":6}
],
"sources":[{"faults":1,"labelled_frames":3,"notes":["a \"note\""],"pairs_by_gap":[{"gap":1,"pairs":1},{"gap":6,"pairs":1}],"unpaired":1,"unpaired_ids":["b"]},{"faults":0,"labelled_frames":1,"notes":[],"pairs_by_gap":[{"gap":2,"pairs":1}],"unpaired":0,"unpaired_ids":[]}]}
)");
}

TEST(PlanJson, IsWrittenInPieces) {
  Plan plan = small_plan();
  plan.shards[1].samples.assign(5000, plan.shards[0].samples[0]);
  std::string text;
  std::size_t longest = 0;
  int pieces = 0;
  write_plan(plan, [&](std::string_view piece) {
    text += piece;
    longest = std::max(longest, piece.size());
    ++pieces;
  });
  EXPECT_EQ(text, to_json(plan));
  EXPECT_GT(pieces, 3);
  EXPECT_LT(longest, std::size_t{70000});
  EXPECT_EQ(parse_plan(text, "p").shards[1].samples.size(), 5000U);
}

TEST(PlanJson, NamesTheDamagedLineAndEveryFaultInIt) {
  std::string text = to_json(small_plan());
  text.replace(text.find("\"gap\":1"), 7, "\"gap\":9");
  text.replace(text.find("\"index\":5"), 9, "\"index\":x");
  EXPECT_THROWS(parse_plan(text, "plan.json"), std::runtime_error, "plan.json:7:");
  text = to_json(small_plan());
  text.replace(text.find("\"gap\":6"), 7, "\"gap\":9");
  text.replace(text.find("\"id\":\"s2\""), 9, "\"id\":null");
  EXPECT_THROWS(
      parse_plan(text, "plan.json"), std::runtime_error,
      ::testing::Eq("plan.json:8: $.shards[0].samples[1].id: expected text, got null\n"
                    "plan.json:8: $.shards[0].samples[1].gap: expected an integer 0..6, got 9"));
}

struct Damage {
  std::string what;
  std::string with;
  std::string fault;
};

TEST(PlanJson, EveryRuleIsChecked) {
  const std::vector<Damage> table = {
      {"\"eventgan-plan\"", "\"eventgan-commit-record\"",
       "p:1: expected a line {\"format\":\"eventgan-plan\",\"version\":...,, got \"{\\\"format"},
      {"\"version\":\"1.0\"", "\"version\":1", "p:1: $.version: expected text, got 1"},
      {"\"version\":\"1.0\"", "\"version\":\"2.0\"",
       "expected a plan of version \"1.0\" (this program reads versions 1.x), got \"2.0\", in p: "
       "it "
       "was written by another version of eventgan"},
      {"\"name\":\"job\"", "\"name\":7", "p:4: $.name: expected text, got 7"},
      {"\"bb\"", "2", "p:2: $.fingerprint.manifest: expected text, got 2"},
      {"{\"manifest\":\"bb\"", "{\"weights\":\"bb\"", "p:2: $.weights: expected the key once"},
      {"\"height\":3", "\"height\":0", "p:9: $.shards[0].height: expected an integer"},
      {"\"height\":3", "\"depth\":3,\"height\":3", "p:9: $.shards[0].depth: expected"},
      {"\"source\":1", "\"source\":2", "p: expected a source 0..1, got 2"},
      {"00001-of-00002.h5", "00001-of-00002.h6", "$.shards[1].name: expected a shard's name"},
      {"\"gap\":2,", "\"gap\":2,\"gap\":2,", "p:11: $.gap: expected the key"},
      {"\"gap\":2,", "\"gap\":2,\"Gap\":2,", "p:11: $.shards[1].samples[0].Gap: expected"},
      {"\"label\":\"label#1\",", "", "p:7: $.shards[0].samples[0].label: expected text"},
      {"\"faults\":1", "\"faults\":-1", "$.sources[0].faults: expected an integer"},
      // Another layout of the same values, or half of it.
      {",\n\"name\"", ", \n\"name\"", "p:3: expected a line \"manifest\":...,, got"},
      {"\n\"sources\"", "\"sources\"", "expected the line ],, got"},
      {"{\"gap\":2", " {\"gap\":2", "p:11: expected a sample, got \" {"},
      {"},\n{\"fault\"", "}\n{\"fault\"", "p:8: expected a line ],...}, got"},
      {"\n],\"source\":0", ",\n],\"source\":0", "p:9: expected a sample, got \"],"},
      {"[]}]}\n", "[]}]\n", "expected a line \"sources\":...}, got"},
      {"[]}]}\n", "[]}]}\n\n", "p:15: expected the end of the file, got \"\""},
  };
  for (const Damage& damage : table) {
    std::string text = to_json(small_plan());
    const std::size_t at = text.find(damage.what);
    ASSERT_NE(at, std::string::npos) << damage.what;
    text.replace(at, damage.what.size(), damage.with);
    EXPECT_THROWS(parse_plan(text, "p"), std::runtime_error, damage.fault) << damage.with;
  }
}

TEST(PlanJson, OfALaterMinorVersionNamesWhatIsNotKnown) {
  std::string text = to_json(small_plan());
  const auto replace = [&](const std::string& what, const std::string& with) {
    const std::size_t at = text.find(what);
    ASSERT_NE(at, text.npos) << what;
    text.replace(at, what.size(), with);
  };
  replace("\"1.0\"", "\"1.2\"");
  replace("\"manifest\":\"{", "\"host\":{\"name\":\"a\"},\n\"manifest\":\"{");
  replace("\"gap\":1,", "\"gap\":1,\"gap_s\":0.5,");
  replace("\"source\":0,", "\"source\":0,\"wide\":1,");
  const Plan plan = parse_plan(text, "p");
  EXPECT_THAT(plan.unknown,
              ::testing::ElementsAre("$.host", "$.shards[].samples[].gap_s", "$.shards[].wide"));
  EXPECT_EQ(to_json(plan), to_json(small_plan()));
  EXPECT_THAT(notes_of({}, plan.unknown),
              ::testing::ElementsAre("the folder is of a later version, and has what this program "
                                     "does not know: $.host, $.shards[].samples[].gap_s, "
                                     "$.shards[].wide"));
  replace("\"1.2\"", "\"1.0\"");
  EXPECT_THROWS(parse_plan(text, "p"), std::runtime_error, "expected a line \"manifest\":");
}

TEST(PlanJson, NoPartOfAPlanIsAPlan) {
  const std::string text = to_json(small_plan());
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_THROWS(parse_plan(text.substr(0, size), "p"), std::runtime_error, "the end of the")
        << size;
  }
}

TEST(PlanJson, RefusesNamesThatAreNotUtf8) {
  Plan plan = small_plan();
  plan.shards[0].samples[0].sample_id = "\xff";
  try {
    to_json(plan);
    ADD_FAILURE() << "not refused";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("expected names in UTF-8, got other bytes, in {"));
    EXPECT_NO_THROW(std::rethrow_if_nested(error)) << "the library's own words help nobody";
  }
}

TEST(PlanJson, ANoteMayNameAFileThatIsNotUtf8) {
  Plan plan = small_plan();
  plan.sources[0].notes = {"1 file left out in a: caf\xe9.txt"};
  EXPECT_THAT(parse_plan(to_json(plan), "plan.json").sources[0].notes,
              ::testing::ElementsAre("1 file left out in a: caf\xef\xbf\xbd.txt"));
}

TEST(FingerprintDifferences, NameTheFieldAndBothValues) {
  EXPECT_THAT(fingerprint_differences({{"a", "1"}, {"b", "2"}}, {{"a", "1"}, {"b", "2"}}),
              ::testing::IsEmpty());
  EXPECT_THAT(fingerprint_differences({{"a", "1"}, {"b", "2"}}, {{"a", "3"}, {"c", "4"}}),
              ::testing::ElementsAre("a: expected 1, got 3", "b: expected 2, got nothing",
                                     "c: expected nothing, got 4"));
}

PlanOutline read(const std::string& text) {
  std::istringstream stream(text);
  return read_plan_outline(stream, "p");
}

TEST(PlanOutline, IsThePlanWithoutItsSamples) {
  const Plan plan = small_plan();
  for (const PlanOutline& outline : {outline_of(plan), read(to_json(plan))}) {
    EXPECT_EQ(outline.name, plan.name);
    EXPECT_EQ(outline.manifest_text, plan.manifest_text);
    EXPECT_EQ(outline.fingerprint, plan.fingerprint);
    ASSERT_EQ(outline.sources.size(), 2U);
    EXPECT_EQ(outline.sources[0].unpaired_ids, plan.sources[0].unpaired_ids);
    EXPECT_THAT(outline.shards,
                ::testing::ElementsAre(ShardOutline{"job-train-00000-of-00002.h5", 0, {3, 4}, 2},
                                       ShardOutline{"job-train-00001-of-00002.h5", 1, {5, 6}, 1}));
    EXPECT_EQ(outline.sample_count(), 3);
  }
}

TEST(PlanOutline, CountsManySamplesAndSeesEveryFaultButThoseInOne) {
  EXPECT_TRUE(read(to_json(Plan{})).shards.empty());
  Plan plan = small_plan();
  plan.shards[0].samples.assign(20000, plan.shards[1].samples[0]);
  EXPECT_EQ(read(to_json(plan)).sample_count(), 20001);
  std::string text = to_json(small_plan());
  text.replace(text.find("\"gap\":1"), 7, "\"gap\":9");
  EXPECT_EQ(read(text).sample_count(), 3);
  text.replace(text.find("\"width\":4"), 9, "\"width\":0");
  EXPECT_THROWS(read(text), std::runtime_error, "p:9: $.shards[0].width: expected");
}

TEST(PlanOutline, NoPartOfAPlanHasOne) {
  const std::string text = to_json(small_plan());
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_THROWS(read(text.substr(0, size)), std::runtime_error, "the end of the") << size;
  }
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/events/recording_labels.h"

#include "manifests/files/input_file.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/testing/npy_bytes.h"

namespace eventgan {
namespace {

class RecordingLabelsTest : public FolderTest {
 protected:
  RecordingLabels read(const std::string& name, const std::string& text) const {
    write(name, text);
    return read_recording_labels(at(name));
  }
  void refuses(const std::string& name, const std::string& text, const Texts& parts) const {
    for (const std::string& part : parts) {
      EXPECT_THROWS(read(name, text), InputError, part) << text;
    }
  }
};

constexpr char kHeader[] = "time_s,left,top,right,bottom,class,category\n";

TEST_F(RecordingLabelsTest, CsvHasALineABoxAndTimesWithout) {
  const RecordingLabels labels =
      read("a.csv", std::string(kHeader) +
                        "1.5,1,2,30.25,40,car,easy\r\n2.5,5,6,7,8,bus,hard\n 1.5 , 9,9,11,12,car,\n"
                        "\n3\n4,,,,,,\n2.5,0,0,1,1,car,dont_care");
  EXPECT_THAT(labels.class_names, ElementsAre("car", "bus"));
  ASSERT_EQ(labels.annotations.size(), 4u);
  EXPECT_THAT(labels.annotations.at(1.5).boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {1, 2, 30.25, 40}, .difficulty = 0},
                          Box{.class_id = 0, .xyxy = {9, 9, 11, 12}}));
  EXPECT_EQ(labels.annotations.at(1.5).original,
            "1.5,1,2,30.25,40,car,easy\n 1.5 , 9,9,11,12,car,\n");
  EXPECT_THAT(labels.annotations.at(2.5).boxes,
              ElementsAre(Box{.class_id = 1, .xyxy = {5, 6, 7, 8}, .difficulty = 2},
                          Box{.class_id = 0, .xyxy = {0, 0, 1, 1}, .ignore = true}));
  EXPECT_EQ(labels.annotations.at(3), (Annotation{"3\n", {}, {}}));
  EXPECT_THAT(labels.annotations.at(4).boxes, IsEmpty());
}

TEST_F(RecordingLabelsTest, OfATableItsFirstLineTellsWhetherItHasLabels) {
  for (const auto& [header, is] : {std::pair("time_s,left", true), {"t,x,y,p", false}}) {
    std::string text = std::string(header) + "\n";
    for (int i = 0; i < 100'000; ++i) text += "0,0,1,1250000\n";
    write("table.csv", text);
    const InputCounter counter;
    EXPECT_EQ(is_label_table(at("table.csv")), is);
    EXPECT_LE(counter.of(at("table.csv")).bytes, 1u << 14);
  }
}

TEST_F(RecordingLabelsTest, CsvMayHaveItsColumnsInAnyOrderAndNoCategoryAndCommasInQuotes) {
  RecordingLabels labels = read("a.csv",
                                "\xEF\xBB\xBF"
                                "class, bottom,right,top,left,time_s\ncar,4,3,2,1,0.25\n");
  EXPECT_EQ(labels.annotations.at(0.25).boxes.at(0), (Box{.class_id = 0, .xyxy = {1, 2, 3, 4}}));
  labels = read("a.csv", kHeader + "1,1,2,3,4,\"a, \"\"b\"\"\",easy\r\n"s);
  EXPECT_THAT(labels.class_names, ElementsAre("a, \"b\""));
  EXPECT_EQ(labels.annotations.at(1).original, "1,1,2,3,4,\"a, \"\"b\"\"\",easy\n");
}

TEST_F(RecordingLabelsTest, CsvNamesEveryLineThatIsWrong) {
  const std::string place = at("a.csv").string();
  refuses("a.csv",
          std::string(kHeader) +
              "x,1,2,3,4,car,\n1,1,2,nan,4,car,\n1,1,2,3,4,,\n"
              "1,1,2,3,4,car,eazy\n1,2,3\n\xff\n1,1,2,3,4,\"a\"b,easy\n",
          {"expected a time in seconds, got \"x\", in " + place + " (line 2)",
           "expected right as a number from -1000000 to 1000000, got \"nan\", in " + place +
               " (line 3)",
           "expected a class, got none, in " + place + " (line 4)",
           "expected easy, hard, dont_care or nothing, got \"eazy\", in " + place + " (line 5)",
           "expected 7 fields, got 3, in " + place + " (line 6)",
           "expected UTF-8, got other bytes, in " + place + " (line 7)",
           "got other quotes, in " + place + " (line 8)"});
  refuses("a.csv", "time_s,left,top,right,bottom,class,catgory\n1,1,2,3,4,car,easy\n",
          {"each once, got \"catgory\", in " + place + " (line 1)"});
  refuses("a.csv", "time_s,left,top,right,bottom,class,class\n", {"got \"class\""});
  refuses("a.csv", "time_s,left,top,right,class\n", {"expected a column bottom, got none"});
  refuses("a.csv", "", {"expected a header line"});
  refuses("a.csv", std::string(kHeader) + "1e999,,,,,,\n", {"expected a time in seconds"});
}

TEST_F(RecordingLabelsTest, JsonHasBoxesAndPersons) {
  const RecordingLabels labels = read("a.json", R"({
    "format": "eventgan-labels", "version": 1, "joint_names": ["head", "foot"],
    "samples": [
      { "time_s": 1.5, "boxes": [
          { "left": 1, "top": 2, "right": 3, "bottom": 4.5, "class": "car", "category": "hard" },
          { "left": 1, "top": 2, "right": 3, "bottom": 4, "class": "bus", "track": 7 }] },
      { "time_s": 0.5, "persons": [
          { "joints": [[10, 20, 1], []], "center": [5, 6], "scale": 0.5, "head_box": [1, 2, 3, 4] },
          { "joints": [[10, 20], [30.5, 40, 0]] }] },
      { "time_s": 2 }] })");
  EXPECT_THAT(labels.class_names, ElementsAre("car", "bus"));
  EXPECT_THAT(labels.joint_names, ElementsAre("head", "foot"));
  EXPECT_THAT(labels.annotations.at(1.5).boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {1, 2, 3, 4.5}, .difficulty = 2},
                          Box{.class_id = 1, .xyxy = {1, 2, 3, 4}, .track_id = 7}));
  Person first, second;
  first.joints = {{{10, 20}, 1}, {kMissingPoint, 0}};
  first.center = {5, 6};
  first.scale = 0.5;
  first.head_box = {1, 2, 3, 4};
  second.joints = {{{10, 20}, -1}, {{30.5, 40}, 0}};
  EXPECT_THAT(labels.annotations.at(0.5).persons, ElementsAre(first, second));
  EXPECT_EQ(labels.annotations.at(2).original, R"({"time_s":2})");
}

TEST_F(RecordingLabelsTest, JsonTellsEveryFaultAndTheNearestKey) {
  refuses("a.json", R"({ "format": "eventgan-labels", "version": 1, "joint_names": ["head"],
    "samples": [
      { "time_s": "now", "boxs": [] },
      { "time_s": 1, "boxes": [{ "left": 1, "top": 2, "right": 3, "class": "", "category": "eazy" }],
        "persons": [{ "joints": [[1], [2, 3]] }] },
      { "time_s": 1 }] })",
          {R"($.samples[0].time_s: expected a number)", R"(expected the key "boxes" or none)",
           "$.samples[1].boxes[0].bottom: expected a number",
           R"($.samples[1].boxes[0].class: expected a class without control characters, got "")",
           R"(expected "easy", "hard" or "dont_care", got "eazy")",
           "$.samples[1].persons[0].joints[0]: expected [x, y], [x, y, visible] or []",
           "$.samples[1].persons[0].joints: expected as many as joint_names, 1, got 2",
           "$.samples[2]: expected each time once"});
  refuses("a.json", R"({"format": "coco", "version": 1})", {"expected \"eventgan-labels\""});
  refuses("a.json", "{", {"a.json"});
}

// A shard keeps names as texts that end at a NUL: "ca\0r" and "ca\0t" would be one class there.
TEST_F(RecordingLabelsTest, NamesHaveNoControlCharacters) {
  const std::string place = at("a.csv").string();
  refuses(
      "a.csv", kHeader + "1,1,2,3,4,ca\0r,\n1,1,2,3,4,car,\n1,1,2,3,4,\x1b[31mred,\n"s,
      {"expected a class without control characters, got \"ca\\u0000r\", in " + place + " (line 2)",
       "got \"\\u001b[31mred\", in " + place + " (line 4)"});
  refuses("a.csv", kHeader + "1,1,2,3,4,car,ea\0sy\n"s, {"nothing, got \"ea\\u0000sy\""});
  for (const std::string bad : {"\\u0000", "\\n", "\\u007f", "\\u009b"}) {
    refuses("a.json",
            R"({ "format": "eventgan-labels", "version": 1, "joint_names": ["he)" + bad +
                R"(ad"], "samples": [{ "time_s": 1, "boxes": [
                            { "left": 1, "top": 2, "right": 3, "bottom": 4, "class": "ca)" +
                bad + R"(r" }] }] })",
            {"$.joint_names[0]: expected a joint's name without control characters, got \"he",
             "$.samples[0].boxes[0].class: expected a class without control characters, got \"ca"});
  }
  EXPECT_THAT(read("a.csv", kHeader + "1,1,2,3,4,été — 自行车,\n"s).class_names,
              ElementsAre("été — 自行车"));
}

TEST_F(RecordingLabelsTest, AJointStandsOnce) {
  refuses("a.json", R"({ "format": "eventgan-labels", "version": 1,
                         "joint_names": ["head", "foot", "head"], "samples": [] })",
          {R"($.joint_names[2]: expected each joint once, got "head")"});
}

TEST_F(RecordingLabelsTest, BothFormsTakePlacesWithinAMillionPixels) {
  const std::string place = at("a.csv").string();
  EXPECT_EQ(read("a.csv", kHeader + std::string("1,-1e6,0,1e6,9,car,\n")).annotations.size(), 1u);
  refuses("a.csv", kHeader + std::string("1,-1e300,0,1e300,9,car,\n1,0,0,1000001,9,car,\n"),
          {"expected left as a number from -1000000 to 1000000, got \"-1e300\", in " + place +
               " (line 2)",
           "expected right as a number from -1000000 to 1000000, got \"1000001\", in " + place +
               " (line 3)"});
  refuses("a.json", R"({ "format": "eventgan-labels", "version": 1, "samples": [{ "time_s": 1,
            "boxes": [{ "left": -1e300, "top": 0, "right": 9, "bottom": 9, "class": "car" }] }] })",
          {"$.samples[0].boxes[0].left: expected a number -1e+06..1e+06"});
}

TEST_F(RecordingLabelsTest, ClassesAreNumberedAsTheyFirstOccurHoweverManyThereAre) {
  constexpr int kCount = 60000;  // comparing each with all before it would take half a minute
  std::string text = kHeader;
  for (int repeat = 0; repeat < 2; ++repeat) {
    for (int i = kCount; i-- > 0;) text += "1,1,2,3,4,class " + std::to_string(i) + ",\n";
  }
  const RecordingLabels labels = read("a.csv", text);
  ASSERT_EQ(labels.class_names.size(), std::size_t{kCount});
  EXPECT_EQ(labels.class_names[1], "class 59998");
  const std::vector<Box>& boxes = labels.annotations.at(1).boxes;
  for (int i = 0; i < kCount; ++i) ASSERT_EQ(boxes.at(kCount + i).class_id, i);
}

/// Rows of t, x, y, w, h, class_id and track_id.
std::string boxes(const std::vector<std::array<double, 7>>& rows) {
  std::string bytes;
  const auto append = [&](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  for (const auto& row : rows) {
    append(static_cast<std::uint64_t>(row[0]));
    for (std::size_t i = 1; i < 5; ++i) append(static_cast<float>(row[i]));
    append(static_cast<std::uint8_t>(row[5]));
    append(static_cast<std::uint32_t>(row[6]));
  }
  return testing::npy_file(
      "{'descr': [('t', '<u8'), ('x', '<f4'), ('y', '<f4'), ('w', '<f4'), ('h', '<f4'), "
      "('class_id', '|u1'), ('track_id', '<u4')], 'fortran_order': False, 'shape': (" +
          std::to_string(rows.size()) + ",), }",
      bytes);
}

TEST_F(RecordingLabelsTest, NpyHasPropheseesBoxes) {
  const std::string text = boxes({{2'500'000, 1, 2, 3, 4, 1, 9},
                                  {1'500'000, 0.5, 0, 1, 1, 0, 8},
                                  {2'500'000, 5, 6, 0, 1, 0, 8}});
  RecordingLabels labels = read("a_bbox.npy", text);
  EXPECT_THAT(labels.class_names, ElementsAre("class 1", "class 0"));
  ASSERT_EQ(labels.annotations.size(), 2u);
  EXPECT_THAT(labels.annotations.at(2.5).boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {1, 2, 4, 6}, .track_id = 9},
                          Box{.class_id = 1, .xyxy = {5, 6, 5, 7}, .track_id = 8}));
  EXPECT_EQ(labels.annotations.at(1.5).original,
            R"({"t":1500000,"x":0.5,"y":0.0,"w":1.0,"h":1.0,"class_id":0,"track_id":8})"
            "\n");
  write("label_map_dictionary.json", R"({"0": "car", "1": "two wheeler"})");
  EXPECT_THAT(read("a_bbox.npy", text).class_names, ElementsAre("two wheeler", "car"));
  EXPECT_THAT(read("b_bbox.npy", boxes({})).annotations, IsEmpty());
  EXPECT_THAT(recording_label_companions(at("a_bbox.npy")),
              ElementsAre(at("label_map_dictionary.json")));
  EXPECT_THAT(recording_label_companions(at("a.csv")), IsEmpty());
}

TEST_F(RecordingLabelsTest, NpyIsStrict) {
  const double nan = std::nan("");
  refuses(
      "a.npy", boxes({{1, nan, 2, 3, 4, 1, 9}, {2, 1, 2, nan, 4, 1, 9}, {3, 1, 2e6, 3, 4, 1, 9}}),
      {"expected x in -1e+06..1e+06, got nan, in", "a.npy (row 0)",
       "expected w in -1e+06..1e+06, got nan, in", "a.npy (row 1)", "expected y in", "(row 2)"});
  refuses("b.npy", boxes({{1e19, 1, 2, 3, 4, 1, 9}}), {"expected numbers below 2^63"});
  refuses("c.npy", boxes({{1, 1, 2, 3, 4, 1, 9}}) + "x", {"expected 1 rows of 29 bytes"});
  refuses("d.npy", testing::npy_doubles({2}, {1, 2}), {"expected a structured array [N]"});
  refuses("e.npy",
          testing::npy_file("{'descr': [('t', '<u8'), ('x', '<f4')], 'fortran_order': False, "
                            "'shape': (0,), }",
                            ""),
          {"expected a field \"y\" of boxes, got none"});
  write("label_map_dictionary.json", R"({"0": "car"})");
  refuses("f.npy", boxes({{1, 1, 2, 3, 4, 1, 9}}),
          {"expected a class of label_map_dictionary.json, got class_id 1"});
  write("label_map_dictionary.json", R"({"car": 0})");
  refuses("g.npy", boxes({}), {"expected {\"0\": \"car\", ...}, got \"car\""});
  write("label_map_dictionary.json", R"({"0": "car", "1": "car"})");
  refuses("h.npy", boxes({}), {R"(got "1": "car" beside another)"});
  write("label_map_dictionary.json", R"({"0": "car", "00": "van"})");
  refuses("i.npy", boxes({}), {R"(got "00": "van" beside another)"});
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/own_labels/detail/mot_labels.h"

#include <algorithm>
#include <sstream>

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

auto read_mot(const std::string& text, const MotForm& form = {}) {
  return parse_mot_labels(text, form, "gt.txt");
}

/// Of frame 1.
std::string mot_fault(const std::string& lines) {
  const auto frames = read_mot(lines + "2,1,1,1,1,1,1\n");
  EXPECT_EQ(fault_of(frames.at(2)), "no fault");  // of its frame alone
  return fault_of(frames.at(1));
}

TEST(MotLabels, CountFrom1) {
  const auto frames = read_mot(
      "3,2,1,1,1920,1080,1,1,1\r\n1,5,10.5,20,4,8.25,1,3,0.25\r\n\r\n"
      "3,4, -9, 2, 30, 40, 0, 1, 0");
  ASSERT_THAT(frames, SizeIs(2));
  const auto& third = *frames.at(3);
  EXPECT_EQ(third.original, "3,2,1,1,1920,1080,1,1,1\r\n3,4, -9, 2, 30, 40, 0, 1, 0");
  EXPECT_EQ(third.size, std::nullopt);
  ASSERT_THAT(third.boxes, SizeIs(2));
  EXPECT_EQ(third.boxes[0].class_name, "pedestrian");
  EXPECT_EQ(third.boxes[0].box, (Box{.xyxy = {0, 0, 1920, 1080}, .track_id = 2}));
  EXPECT_EQ(third.boxes[1].box, (Box{.xyxy = {-10, 1, 20, 41}, .track_id = 4, .ignore = true}));
  const auto& first = *frames.at(1);
  EXPECT_EQ(first.boxes.at(0).class_name, "car");
  EXPECT_EQ(first.boxes.at(0).box, (Box{.xyxy = {9.5, 19, 13.5, 27.25}, .track_id = 5}));
  EXPECT_THAT(read_mot(""), IsEmpty());
}

TEST(MotLabels, ClassesOfDistractorsAndCrowdsAreToBeIgnored) {
  const std::vector<std::pair<std::string, bool>> classes{
      {"pedestrian", false},    {"person_on_vehicle", true},
      {"car", false},           {"bicycle", false},
      {"motorbike", false},     {"non_motorized_vehicle", false},
      {"static_person", true},  {"distractor", true},
      {"occluder", false},      {"occluder_on_the_ground", false},
      {"occluder_full", false}, {"reflection", true},
      {"crowd", true}};
  std::string text;
  for (std::size_t i = 1; i <= classes.size(); ++i) {
    text += "1," + std::to_string(i) + ",1,1,2,2,1," + std::to_string(i) + ",1\n";
  }
  const auto frames = read_mot(text);
  const auto& boxes = frames.at(1)->boxes;
  ASSERT_EQ(boxes.size(), classes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    EXPECT_EQ(boxes[i].class_name, classes[i].first);
    EXPECT_EQ(boxes[i].box.ignore, classes[i].second) << classes[i].first;
  }
}

TEST(MotLabels, Of2015AndShorterOnesAreOfPedestrians) {
  const auto frames = read_mot(
      "1,1,1,1,2,2,1,-1,-1,-1\n1,2,1,1,2,2,0,-9.5,3.25,0\n1,3,1,1,2,2,1\n"
      "1,4,1,1,2,2,1,2\n");
  const auto& boxes = frames.at(1)->boxes;
  ASSERT_THAT(boxes, SizeIs(4));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(boxes[i].class_name, "pedestrian");
    EXPECT_EQ(boxes[i].box.ignore, i == 1);
  }
  EXPECT_EQ(boxes[3].class_name, "person_on_vehicle");
}

TEST(MotLabels, ABadLineSpoilsItsFrameAlone) {
  const std::pair<std::string, std::string> cases[] = {
      {"1,1,1,1,1,1\n", "expected 7 to 10 columns, got 6, in gt.txt:1"},
      {"1,1,1,1,1,1,1,1,1,1,1\n", "expected 7 to 10 columns, got 11, in gt.txt:1"},
      {"1,1,nan,1,1,1,1\n", "for bb_left, got 'nan'"},
      {"1,1,1,1e7,1,1,1\n", "for bb_top, got '1e7'"},
      {"1,1,1,1,inf,1,1\n", "for bb_width, got 'inf'"},
      {"1,1,1,1,1,,1\n", "for bb_height, got ''"},
      // In a column that is not read.
      {"1,7,1,1,1,1,1,1,\0\n"s, "expected text, got a NUL in it, in gt.txt:1"},
      {"1,7,1,1,1,1,1\n1,8,1,1,1,1,1\n1,7,2,2,2,2,1\n",
       "expected each id once in a frame, got 7 twice, in gt.txt:3"},
      {"1,7,1,1,1,1,1\n1,8,1,1,1,x,1\n1,9,y,2,2,2,1\n", ":2"}};
  for (const auto& [lines, fault] : cases) EXPECT_THAT(mot_fault(lines), HasSubstr(fault));
  for (const std::string id : {"-2", "1.5", "", "9007199254740993"}) {
    EXPECT_EQ(mot_fault("1," + id + ",1,1,1,1,1\n"),
              "expected an id from 0, or -1, got '" + id + "', in gt.txt:1");
  }
  for (const std::string conf : {"-0.5", "-2", "1.5", "nan", "x"}) {
    EXPECT_THAT(mot_fault("1,1,1,1,1,1," + conf + ",1,1\n"),
                HasSubstr("expected a conf from 0 to 1, got '" + conf + "'"));
  }
  for (const std::string kind : {"0", "14", "-1", "1.5"}) {
    EXPECT_THAT(mot_fault("1,1,1,1,1,1,1," + kind + ",1\n"),
                HasSubstr("expected a class from 1 to 13, got '" + kind + "'"));
  }
}

TEST(MotLabels, WhatIsNotUsedOrOnlyUnusualIsTaken) {
  const std::string text =
      "1.0,2.0,1,1,5,5,1.0,3.0,7\n1,3,1,1,5,5,1,-1,nan,x\n1,0,1,1,5,5,-1\n1,-1,1,1,5,5,-1\n"
      "1,-1.0,2,2,5,5,1\n1,4,1,1,0,5,1\n";
  const auto frames = read_mot(text);
  ASSERT_THAT(frames, SizeIs(1));
  const auto& labels = *frames.at(1);
  EXPECT_EQ(labels.original, text);
  ASSERT_THAT(labels.boxes, SizeIs(6));
  EXPECT_EQ(labels.boxes[0].class_name, "car");
  const std::array<std::int64_t, 6> ids{2, 3, 0, -1, -1, 4};
  for (std::size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(labels.boxes[i].box.track_id, ids[i]);
    EXPECT_FALSE(labels.boxes[i].box.ignore);
  }
  EXPECT_EQ(labels.boxes[5].box.xyxy, (Rectangle{0, 0, 0, 5}));  // left out by its image's size
  EXPECT_THAT(labels.remarks,
              ElementsAre("id 0 taken as it is", "conf -1 taken for 1", "id -1 taken for none",
                          "conf -1 taken for 1", "id -1 taken for none"));
}

TEST(MotLabels, AnEmptyColumnAtTheEndIsNone) {
  const auto frames = read_mot("1,1,1,1,2,2,1,3,0.86,\n1,2,1,1,2,2,1,3,0.86,0\n");
  EXPECT_EQ(frames.at(1)->boxes.at(0).class_name, "car");
  EXPECT_EQ(frames.at(1)->boxes.at(1).class_name, "pedestrian");  // coordinates of 2015
}

TEST(MotLabels, MayHaveClassesOfTheirOwn) {
  const MotForm form{0, {"car", "truck", "dog"}};
  const auto frames =
      read_mot("1,1,10,20,30,40,1,1,1.0\n1,2,60,20,30,40,0,3,1.0,\n2,1,1,1,5,5,1,4,1\n", form);
  const auto& boxes = frames.at(1)->boxes;
  ASSERT_THAT(boxes, SizeIs(2));
  EXPECT_EQ(boxes[0].class_name, "car");
  EXPECT_EQ(boxes[0].box, (Box{.xyxy = {10, 20, 40, 60}, .track_id = 1}));
  EXPECT_EQ(boxes[1].class_name, "dog");
  EXPECT_EQ(boxes[1].box, (Box{.xyxy = {60, 20, 90, 60}, .track_id = 2, .ignore = true}));
  EXPECT_EQ(fault_of(frames.at(2)), "expected a class from 1 to 3, got '4', in gt.txt:3");
}

TEST(MotLabels, VisDronesTablesShowByTheirLastColumns) {
  const std::string text = "1,0,11,21,30,40,1,4,0,2\n1,1,1,1,9,9,0,0,0,0\n1,2,1,1,9,9,1,11,1,1\n";
  EXPECT_TRUE(is_visdrone_table(text));
  EXPECT_TRUE(is_visdrone_table("1,0,11,21,30,40,1,1.0,0,0"));
  for (const char* other :
       {"", "1,1,1,1,2,2,1,-1,-1,-1", "1,1,1,1,2,2,1,3.5,0,0", "1,1,1,1,2,2,1,12,0,0",
        "1,1,1,1,2,2,1,1,2,0", "1,1,1,1,2,2,1,1,0,3", "1,1,1,1,2,2,1,1,1", "1,1,1,1,2,2,1,0,0,0",
        "1,0,11,21,30,40,1,4,0,2\n1,1,1,1,2,2,1,-1,-1,-1"}) {
    EXPECT_FALSE(is_visdrone_table(other)) << other;
  }
  const auto frames = read_mot(text, {.is_visdrone = true});
  const auto& labels = *frames.at(1);
  ASSERT_THAT(labels.boxes, SizeIs(3));
  EXPECT_EQ(labels.boxes[0].class_name, "car");
  EXPECT_EQ(labels.boxes[0].box,
            (Box{.xyxy = {10, 20, 40, 60}, .truncation = 0, .occlusion = 2, .track_id = 0}));
  EXPECT_EQ(labels.boxes[1].class_name, "ignored regions");
  EXPECT_TRUE(labels.boxes[1].box.ignore);
  EXPECT_EQ(labels.boxes[2].class_name, "others");
  EXPECT_EQ(labels.boxes[2].box.truncation, 1);
  EXPECT_FALSE(labels.boxes[2].box.ignore);
  EXPECT_THAT(labels.remarks, IsEmpty());
}

TEST(MotLabels, ALineThatDoesNotTellItsFrameIsRefused) {
  for (const std::string line : {"0,1,1,1,1,1,1", "-1,1,1,1,1,1,1", "1.5,1,1,1,1,1,1", "x", ",,",
                                 "1000000000,1,1,1,1,1,1", "1 2 3", "99999999999999999999,1"}) {
    for (const char* end : {"", "\n"}) {
      EXPECT_THROWS(read_mot("1,1,1,1,1,1,1\n" + line + end), InputError,
                    "expected a frame number from 1, got '", "', in gt.txt:2")
          << line;
    }
  }
}

constexpr char kSeqinfo[] =
    "[Sequence]\r\nname=MOT17-02-FRCNN\r\nimDir=img1\r\nframeRate=30\r\nseqLength=600\r\n"
    "imWidth=1920\r\nimHeight=1080\r\nimExt=.jpg\r\n";

TEST(MotSequences, SayHowFastTheyAre) {
  for (const std::string& text :
       {std::string(kSeqinfo),
        "; a\n#b\n[Other]\nname=x\n\n" + std::string(kSeqinfo) + "\nmore = 1",
        "\xEF\xBB\xBF" + std::string(kSeqinfo) + "[Next]\nname=y\n"}) {
    const MotSequence sequence = parse_mot_sequence(text, "seqinfo.ini");
    EXPECT_EQ(sequence.frames_per_second, 30);
    EXPECT_EQ(sequence.length, 600);
    EXPECT_EQ(sequence.size, (ImageSize{1080, 1920}));
  }
  EXPECT_EQ(parse_mot_sequence("[Sequence]\nframeRate = 29.97\nseqLength = 1\nimWidth = 1\n"
                               "imHeight = 2",
                               "seqinfo.ini")
                .frames_per_second,
            29.97);
}

TEST(MotSequences, SayNothingOfWhatTheirFilesLack) {
  const MotSequence length =
      parse_mot_sequence("[Sequence]\nname=S1\nseqLength=3.0\nimWidth=9\n", "seqinfo.ini");
  EXPECT_EQ(length.length, 3);
  EXPECT_EQ(length.frames_per_second, std::nullopt);
  EXPECT_EQ(length.size, std::nullopt);  // a width alone
  const MotSequence rate =
      parse_mot_sequence("[Sequence]\nframeRate=25\nseqLength=\n", "seqinfo.ini");
  EXPECT_EQ(rate.frames_per_second, 25);
  EXPECT_EQ(rate.length, std::nullopt);
}

TEST(MotSequences, AreRefusedWhereAnythingIsInDoubt) {
  const std::array<std::string, 3> cases[] = {
      {"[Sequence]", "[sequence]", "expected [Sequence], got none, in seqinfo.ini"},
      {"imExt=", "name=", "expected each key once, got 'name=.jpg', in seqinfo.ini:8"},
      {"imExt=.jpg", "[Sequence]", "expected [Sequence] once, got '[Sequence]'"},
      {"imExt=.jpg", "imExt", "expected a line key=value, got 'imExt', in seqinfo.ini:8"},
      {"=30", "=0", "for frameRate, in seqinfo.ini:4"},
      {"=30", "=-30", "for frameRate, in seqinfo.ini:4"},
      {"=30", "=nan", "for frameRate, in seqinfo.ini:4"},
      {"=30", "=inf", "for frameRate, in seqinfo.ini:4"},
      {"=30", "=1e7", "for frameRate, in seqinfo.ini:4"},
      {"=30", "=30 fps", "for frameRate, in seqinfo.ini:4"},
      {"=600", "=0", "for seqLength, in seqinfo.ini:5"},
      {"=600", "=0.5", "for seqLength, in seqinfo.ini:5"},
      {"=600", "=1.5", "for seqLength, in seqinfo.ini:5"},
      {"=600", "=10000000000", "for seqLength, in seqinfo.ini:5"},
      {"=1920", "=0", "expected a number above 0, got '0' for imWidth, in seqinfo.ini:6"},
      {"=1080", "=99999999", "for imHeight, in seqinfo.ini:7"}};
  for (const auto& [from, to, message] : cases) {
    std::string text = kSeqinfo;
    text.replace(text.find(from), from.size(), to);
    EXPECT_THROWS(parse_mot_sequence(text, "seqinfo.ini"), InputError, message) << text;
  }
}

// Another program's reading of the same files (boxes.csv), which took the corners as they are and
// so lies one pixel farther right and down.
TEST(MotLabels, OfMot17AreThoseThatAnotherProgramRead) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto folder = data / "labelled_frames" / "mot17_mini";
  if (!exists(folder)) GTEST_SKIP() << "skipped: no " << folder;
  std::istringstream table(read_file(folder / "boxes.csv"));
  std::map<std::string, std::vector<std::vector<std::string>>> expected;  // by image
  for (std::string line; std::getline(table, line);) {
    std::istringstream fields(line);
    std::vector<std::string> row(8);
    for (std::string& field : row) std::getline(fields, field, ',');
    if (row[0] != "image") expected[row[0]].push_back(row);
  }
  ASSERT_EQ(expected.size(), 12u);
  std::size_t compared = 0;
  for (const char* name : {"MOT17-02-FRCNN", "MOT17-04-FRCNN"}) {
    const std::string text = read_file(folder / name / "gt.txt");
    std::size_t bytes = 0;
    for (const auto& [number, outcome] : parse_mot_labels(text, {}, "gt.txt")) {
      ASSERT_FALSE(is_fault(outcome)) << outcome.fault().reason;
      const auto& labels = *outcome;
      bytes += labels.original.size();
      const std::string image = name + ("/00000" + std::to_string(number)) + ".jpg";
      const auto& rows = expected.at(image);
      ASSERT_EQ(labels.boxes.size(), rows.size()) << image;
      for (const NamedBox& read : labels.boxes) {
        const auto row = std::find_if(rows.begin(), rows.end(), [&](const auto& one) {
          return std::stoll(one[6]) == read.box.track_id;
        });
        ASSERT_NE(row, rows.end()) << image << ' ' << read.box.track_id;
        const auto& fields = *row;
        EXPECT_EQ(read.box.xyxy, (Rectangle{std::stod(fields[2]) - 1, std::stod(fields[3]) - 1,
                                            std::stod(fields[4]) - 1, std::stod(fields[5]) - 1}));
        const bool is_pedestrian = fields[7].find("cls=1 ") != std::string::npos;
        EXPECT_EQ(read.class_name == "pedestrian", is_pedestrian);
        const bool counts = fields[7].starts_with("conf=1");
        EXPECT_TRUE(counts || read.box.ignore);
        EXPECT_FALSE(counts && is_pedestrian && read.box.ignore);
        ++compared;
      }
    }
    EXPECT_EQ(bytes, text.size());
  }
  EXPECT_EQ(compared, 948u);  // lines of both files
}

}  // namespace
}  // namespace eventgan

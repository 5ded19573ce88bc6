#include "stages/frames/own_labels/detail/csv_labels.h"

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr char kTableHeader[] = "image,class,left,top,right,bottom,track\n";

auto read_csv(const std::string& rows) {
  return parse_csv_labels(kTableHeader + rows, "labels.csv");
}

std::string csv_fault(const std::string& rows) {
  const auto images = read_csv(rows + "other.png,car,0,0,1,1,\n");
  EXPECT_EQ(fault_of(images.at("other.png")), "no fault");  // of its image alone
  return fault_of(images.at("a.png"));
}

TEST(CsvLabels, HaveARowABox) {
  const auto images = read_csv(
      "b.png,person,0,0.25,31,57.5,\r\n"
      "\"x, \"\"y\"\".png\",car,1,2,3,4,7\r\n"
      "b.png,car,-3,1e1,20,30,0\r\n"
      "\r\n"
      "sub/empty.png,,,,,,\r\n"
      "b.png,\"dog, small\",1,1,2,2,9007199254740993");
  ASSERT_THAT(images, SizeIs(3));
  const auto& b = *images.at("b.png");
  ASSERT_THAT(b.boxes, SizeIs(3));
  EXPECT_EQ(b.boxes[0].class_name, "person");
  EXPECT_EQ(b.boxes[0].box, (Box{.xyxy = {0, 0.25, 31, 57.5}}));
  EXPECT_EQ(b.boxes[1].class_name, "car");
  EXPECT_EQ(b.boxes[1].box, (Box{.xyxy = {-3, 10, 20, 30}, .track_id = 0}));
  EXPECT_EQ(b.boxes[2].class_name, "dog, small");
  EXPECT_EQ(b.boxes[2].box.track_id, 9007199254740993);
  EXPECT_EQ(b.original,
            "b.png,person,0,0.25,31,57.5,\r\nb.png,car,-3,1e1,20,30,0\r\n"
            "b.png,\"dog, small\",1,1,2,2,9007199254740993");
  EXPECT_EQ(b.size, std::nullopt);
  EXPECT_EQ(images.at("x, \"y\".png")->boxes.at(0).box, (Box{.xyxy = {1, 2, 3, 4}, .track_id = 7}));
  const auto& empty = *images.at("sub/empty.png");
  EXPECT_THAT(empty.boxes, IsEmpty());
  EXPECT_EQ(empty.original, "sub/empty.png,,,,,,\r\n");
}

TEST(CsvLabels, ARowThatIsThereAlreadyIsLeftOut) {
  const auto images = read_csv(
      "a.png,car,1,2,3,4,5\na.png,bus,1,2,3,4,\r\na.png,car,1,2,3,4,5\nb.png,bus,1,2,3,4,\n"
      "a.png,bus,1,2,3,4,\n");
  ASSERT_FALSE(is_fault(images.at("a.png"))) << fault_of(images.at("a.png"));
  const auto read = numbered(*images.at("a.png"), {"bus", "car"}, {30, 40}, "labels.csv#a.png");
  ASSERT_THAT(read->boxes, SizeIs(2));
  EXPECT_EQ(read->boxes[0].track_id, 5);
  EXPECT_THAT(read->left_out,
              ElementsAre("expected each line once, got it again, in labels.csv:4",
                          "expected each line once, got it again, in labels.csv:6"));
  EXPECT_THAT(read->left_out_at, ElementsAre(2u, 3u));
  EXPECT_THAT(images.at("b.png")->boxes, SizeIs(1));
}

TEST(CsvLabels, RowsOfOneHashAreTwoBoxes) {
  const std::string first = "aa.png,1,1,9,99,Ik2zwEQHfwcepYyN";
  const std::string second = "aa.png,1,1,9,99,gA3HLHx23cvE3cyp";
  // Found for libstdc++'s std::hash, by which rows were told apart once.
  EXPECT_EQ(std::hash<std::string>()(first), std::hash<std::string>()(second));
  const auto images = parse_csv_labels(
      "image,left,top,right,bottom,class\n" + first + "\n" + second + "\n", "labels.csv");
  ASSERT_THAT(images.at("aa.png")->boxes, SizeIs(2));
  EXPECT_TRUE(images.at("aa.png")->boxes[1].again_at.empty());
}

TEST(CsvLabels, ColumnsComeInAnyOrderAndTrackMayBeAbsent) {
  const auto images = parse_csv_labels(
      "\xEF\xBB\xBF"
      "bottom,right,top,left,class,image\n4,3,2,1,car,a.png\n",
      "labels.csv");
  EXPECT_EQ(images.at("a.png")->boxes.at(0).box, (Box{.xyxy = {1, 2, 3, 4}}));
  EXPECT_THAT(read_csv(""), IsEmpty());
}

TEST(CsvLabels, ColumnsAreCalledAsToolsCallThem) {
  const Rectangle expected{1, 2, 4, 6};
  for (const char* table :
       {"filename,width,height,class,xmin,ymin,xmax,ymax\na.png,64,48,car,1,2,4,6\n",
        "image,class,x1,y1,x2,y2,track,note\na.png,car,1,2,4,6,,area=3\n",
        "frame;label;left;top;width;height\na.png;car;1;2;3;4\n",
        "image;label;x;y;w;h\na.png;car;1,0;2;3;4,0\n",
        "filename,width,height,class,x,y,w,h\na.png,64,48,car,1,2,3,4\n",
        "image,class,x,y,bbox_width,bbox_height,width,height\na.png,car,1,2,3,4,64,48\n",
        "image_name\tclass_name\tx_min\ty_min\tx_max\ty_max\na.png\tcar\t1\t2\t4\t6\n",
        ",\"image\",\"xmin\",\"ymin\",\"xmax\",\"ymax\",\"label\"\n0,\"a.png\",1,2,4,6,\"car\"\n",
        "frame,image,label,x1,y1,x2,y2\n12,a.png,car,1,2,4,6\n"}) {
    const auto images = parse_csv_labels(table, "labels.csv");
    ASSERT_THAT(images, SizeIs(1)) << table;
    ASSERT_FALSE(is_fault(images.at("a.png"))) << fault_of(images.at("a.png"));
    EXPECT_EQ(images.at("a.png")->boxes.at(0).box.xyxy, expected) << table;
    EXPECT_EQ(images.at("a.png")->boxes.at(0).class_name, "car") << table;
  }
  EXPECT_THAT(
      parse_csv_labels("filename,width,height,class,xmin,ymin,xmax,ymax\na.png,64,48,,,,,\n",
                       "labels.csv")
          .at("a.png")
          ->boxes,
      IsEmpty());
  EXPECT_EQ(read_csv("a.png,car,1,2,3,4,7.0\n").at("a.png")->boxes.at(0).box.track_id, 7);
}

TEST(CsvLabels, ABadRowSpoilsItsImageAlone) {
  const std::pair<std::string, std::string> cases[] = {
      {",1,2,3,4,", "expected a class without control characters, got ''"},
      {"a\x01,1,2,3,4,", "expected a class without control characters, got 'a?'"},
      {"car,1,2,nan,4,", "expected right as a number from -1000000 to 1000000, got 'nan'"},
      {"car,,2,3,4,", "expected left as a number from -1000000 to 1000000, got ''"},
      {"car,1,2,1e999,4,", "expected right as a number from -1000000 to 1000000, got '1e999'"},
      {"car,1,-1000001,3,4,", "expected top as a number from -1000000 to 1000000, got '-1000001'"},
      {"car,\"1,024\",10,\"1,100\",50,",
       "expected left as a number from -1000000 to 1000000, got '1,024'"},
      {"car,3.5,2,3,4,", "expected left < right and top < bottom, got 3.5, 2, 3, 4"},
      {"car,1,5,3,4,", "expected left < right and top < bottom, got 1, 5, 3, 4"},
      {"car,1,2,3,4,-1", "expected a whole number from 0 as track, got '-1'"},
      {"car,1,2,3,4,1.5", "expected a whole number from 0 as track, got '1.5'"},
      {"car,1,2,3,4,x", "expected a whole number from 0 as track, got 'x'"},
      {"car,1,2,3,4,9223372036854775808",
       "expected a whole number from 0 as track, got '9223372036854775808'"}};
  for (const auto& [row, fault] : cases) {
    EXPECT_EQ(csv_fault("a.png," + row + "\n"), fault + ", in labels.csv:2");
  }
  EXPECT_EQ(csv_fault("a.png,car,3,2,3,4,\n"), "no fault") << "it is left out";
  // In a column that is not read, but kept with the rows.
  EXPECT_EQ(
      fault_of(parse_csv_labels("image,class,left,top,right,bottom,note\na.png,car,1,2,3,4,a\0b\n"s,
                                "labels.csv")
                   .at("a.png")),
      "expected text, got a NUL in it, in labels.csv:2");
  EXPECT_EQ(csv_fault("a.png,car,1,2,3,4,5\na.png,bus,1,2,3,4,5\n"),
            "expected each track once in an image, got 5 twice, in labels.csv:3");
  for (const char* rows : {"a.png,car,1,2,3,4,\na.png,,,,,,\n", "a.png,,,,,,\na.png,car,1,2,3,4,\n",
                           "a.png,,,,,,\na.png,,,,,,\n"}) {
    EXPECT_EQ(csv_fault(rows),
              "expected one row alone of an image without boxes, got another of it, "
              "in labels.csv:3");
  }
  // The first fault is told, and what is right beside it does not count.
  EXPECT_THAT(csv_fault("a.png,car,1,2,3,4,\na.png,car,x,2,3,4,\na.png,car,y,2,3,4,\n"),
              HasSubstr("'x', in labels.csv:3"));
}

TEST(CsvLabels, ARowThatDoesNotTellItsImageIsRefused) {
  const std::string header = kTableHeader;
  const char* shares = "expected edges in pixels, got shares of the image, 0..1, in labels.csv";
  const std::pair<std::string, const char*> cases[] = {
      {"", "expected a header line image,class,left,top,right,bottom, got none, in labels.csv"},
      {"image,class,left,top,right\n", "expected a column bottom, got none, in labels.csv:1"},
      {"image,class,left,top,right,bottom,score\n", "got \"score\", in labels.csv:1"},
      {"image,class,x,y,w,width,height\n", "got \"w\", in labels.csv:1"},
      {"a.png,car,1,2,3,4\n", "got \"a.png\", in labels.csv:1"},
      {"image,class,left,left,top,right,bottom\n", "got \"left\", in labels.csv:1"},
      {header + "a.png,car,0.1,0.2,0.3,0.4,\nb.png,car,0,0,1,1,\nc.png,car,0,0,0.5,0.5,\n", shares},
      {header + "a.png,car,0,0.25,1,1,\n", shares},
      {header + "a.png,car,-0.004,0,1.0004,1,\n", shares},
      {header + "a.png,car,0,0,1,1,\nb.png,car,0,0,0.5,1,\n", shares},
      {header + "a.png,car,0,0,1,1,\nb.png,car,0,0,1,1,\nc.png,car,0,0,1,1,\n", shares},  // whole
      {"image,class,x,y,w,h\na.png,car,0.5,0.25,0.5,0.75\n", "got shares of the image"},
      {header + "a.png,car,1,2,3,4\n", "expected 7 fields, got 6, in labels.csv:2"},
      {header + "a.png,car,1,2,3,4,,\n", "expected 7 fields, got 8, in labels.csv:2"},
      {header + ",car,1,2,3,4,\n", "expected an image without control characters, got ''"},
      {header + "a\0.png,car,1,2,3,4,\n"s, "got 'a?.png'"},
      {header + "a.png,\"car,1,2,3,4,\n", "got other quotes, in labels.csv:2"},
      {header + "\xff.png,car,1,2,3,4,\n", "expected UTF-8, got other bytes, in labels.csv:2"}};
  for (const auto& [text, message] : cases) {
    EXPECT_THROWS(parse_csv_labels(text, "labels.csv"), InputError, message) << text;
  }
  EXPECT_THAT(read_csv("a.png,car,0,0,1,1,\nb.png,car,0,0,1.5,1,\n"), SizeIs(2)) << "pixels";
}

TEST(CsvLabels, OfManyImagesEachIsThere) {
  std::string rows;
  for (int i = 0; i < 20000; ++i) {
    rows += std::to_string(i % 10000) + ".png,car,1,2,3,4," + std::to_string(i) + "\n";
  }
  const auto images = read_csv(rows);
  ASSERT_THAT(images, SizeIs(10000));
  EXPECT_EQ(images.at("77.png")->original, "77.png,car,1,2,3,4,77\n77.png,car,1,2,3,4,10077\n");
}

}  // namespace
}  // namespace eventgan

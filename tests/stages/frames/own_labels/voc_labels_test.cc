#include "stages/frames/own_labels/detail/voc_labels.h"

#include <fstream>
#include <sstream>

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr char kBox[] =
    "<bndbox><xmin>1</xmin><ymin>1</ymin><xmax>30</xmax><ymax>20</ymax></bndbox>";

std::string annotation(const std::string& objects) {
  return "<annotation><size><width>30</width><height>20</height><depth>3</depth></size>" + objects +
         "</annotation>\n";
}

std::string object(const std::string& content) { return "<object>" + content + "</object>"; }

ImageLabels read_voc(const std::string& xml, int edges_from = 1) {
  const auto outcome = parse_voc_labels(xml, edges_from, "a.xml");
  EXPECT_EQ(fault_of(outcome), "no fault");
  return *outcome;
}

std::string voc_fault(const std::string& xml) {
  return fault_of(parse_voc_labels(xml, 1, "a.xml"));
}

// As the development kit's own example, 2007_000027.xml, but for the size.
TEST(VocLabels, CountPixelsFrom1) {
  const std::string xml = R"(<?xml version="1.0"?>
<annotation>
	<folder>VOC2012</folder>
	<filename>2007_000027.jpg</filename>
	<source><database>The VOC2007 Database</database></source>
	<size><width>486</width><height>500</height><depth>3</depth></size>
	<segmented>0</segmented>
	<!-- a comment -->
	<object>
		<name>person</name>
		<pose>Unspecified</pose>
		<truncated>0</truncated>
		<difficult>0</difficult>
		<bndbox>
			<xmin>174</xmin><ymin>101</ymin><xmax>349</xmax><ymax>351</ymax>
		</bndbox>
		<part>
			<name>head</name>
			<bndbox><xmin>169</xmin><ymin>104</ymin><xmax>209</xmax><ymax>146</ymax></bndbox>
		</part>
	</object>
	<object>
		<name> traffic &amp; light </name>
		<occluded>1</occluded><truncated>1</truncated><difficult>1</difficult>
		<bndbox><xmax>486</xmax><ymax>500.0</ymax><xmin> 1 </xmin><ymin>45.70000076</ymin></bndbox>
	</object>
	<object>
		<name>cat</name>
		<occluded>0</occluded>
		<bndbox><xmin>7</xmin><ymin>8</ymin><xmax>7</xmax><ymax>8</ymax></bndbox>
	</object>
</annotation>
)";
  const ImageLabels labels = read_voc(xml);
  EXPECT_EQ(labels.original, xml);
  EXPECT_EQ(labels.size, (ImageSize{500, 486}));
  ASSERT_THAT(labels.boxes, SizeIs(3));
  EXPECT_EQ(labels.boxes[0].class_name, "person");
  EXPECT_EQ(labels.boxes[0].box, (Box{.xyxy = {173, 100, 349, 351}, .truncation = 0}));
  EXPECT_EQ(labels.boxes[1].class_name, "traffic & light");
  EXPECT_EQ(labels.boxes[1].box, (Box{.xyxy = {0, 45.70000076 - 1, 486, 500},
                                      .truncation = 1,
                                      .occlusion = 1,
                                      .ignore = true}));
  EXPECT_EQ(labels.boxes[2].box, (Box{.xyxy = {6, 7, 7, 8}, .occlusion = 0}));  // one pixel
}

TEST(VocLabels, MayHaveNoObject) {
  EXPECT_THAT(read_voc(annotation("")).boxes, IsEmpty());
  EXPECT_EQ(read_voc(annotation(object("<name>a</name>" + std::string(kBox)))).boxes.at(0).box,
            (Box{.xyxy = {0, 0, 30, 20}}));
}

TEST(VocLabels, FilesThatAreNotOneAreNamed) {
  EXPECT_THAT(voc_fault(""), HasSubstr("expected XML, got '"));
  EXPECT_THAT(voc_fault("image,class\n"), HasSubstr("expected XML, got '"));
  const std::string whole = annotation(object("<name>a</name>" + std::string(kBox)));
  for (std::size_t length = 0; length + 2 < whole.size(); ++length) {  // the last is a line's end
    EXPECT_THAT(voc_fault(whole.substr(0, length)), HasSubstr("expected XML, got '")) << length;
  }
  EXPECT_EQ(voc_fault("<html/>"), "expected <annotation> alone, got 'html', in a.xml");
  EXPECT_EQ(voc_fault(whole + "<more/>"), "expected <annotation> alone, got 'more', in a.xml");
  EXPECT_EQ(voc_fault("<!DOCTYPE a [<!ENTITY b \"c\">]>" + whole),
            "expected no DOCTYPE, got one, in a.xml");
  EXPECT_EQ(voc_fault(whole + std::string(1, '\0')), "expected text, got a NUL in it, in a.xml");
  std::string wide;  // UTF-16
  for (const char c : whole) wide += {c, '\0'};
  EXPECT_EQ(voc_fault("\xff\xfe" + wide), "expected text, got a NUL in it, in a.xml");
}

std::string with_size(const std::string& size) { return "<annotation>" + size + "</annotation>"; }

TEST(VocLabels, SizesAreOfAnImage) {
  EXPECT_EQ(read_voc(with_size("<size><width>640.0</width><height>48e1</height></size>")).size,
            (ImageSize{480, 640}));
  EXPECT_EQ(voc_fault(with_size("<size/><size/>")), "expected <size> once, got it twice, in a.xml");
  for (const char* width : {"-5", "5.5", "nan", "1000001", "99999999999", "5<b/>"}) {
    const std::string fault = voc_fault(
        with_size("<size><width>" + std::string(width) + "</width><height>5</height></size>"));
    EXPECT_THAT(fault, HasSubstr("<width>")) << width;
  }
}

TEST(VocLabels, MayLeaveTheSizeToTheImage) {
  for (const char* size :
       {"", "<size/>", "<size><width>5</width></size>", "<size><width/><height>5</height></size>",
        "<size><width>0</width><height>0</height><depth>3</depth></size>"}) {
    EXPECT_EQ(read_voc(with_size(size)).size, std::nullopt) << size;
  }
}

TEST(VocLabels, ObjectsAreNamedByTheirNumber) {
  const std::string sound = "<name>a</name>"s + kBox;
  std::vector<std::pair<std::string, std::string>> cases = {
      {kBox, "expected <name>, got none"},
      {"<name>a</name>", "expected <bndbox>, got none"},
      {"<name>b</name>" + sound, "expected <name> once, got it twice"},
      {sound + kBox, "expected <bndbox> once, got it twice"},
      {"<name>a<b/></name>"s + kBox, "expected text alone in <name>, got more"}};
  for (const char* name : {"", " ", "&b;", "a&#1;", "\xff"}) {
    cases.emplace_back("<name>"s + name + "</name>" + kBox,
                       "expected a name without control characters and unknown entities");
  }
  for (const std::string flag : {"difficult", "truncated", "occluded"}) {
    cases.emplace_back(sound + "<" + flag + ">1</" + flag + "><" + flag + ">0</" + flag + ">",
                       "expected <" + flag + "> once, got it twice");
  }
  for (const std::string number : {"nan", "inf", "-1e7", "1e999", "", "1 2", "0x5", "5,5"}) {
    cases.emplace_back("<name>a</name><bndbox><xmin>1</xmin><ymin>" + number +
                           "</ymin><xmax>9</xmax><ymax>9</ymax></bndbox>",
                       "expected a number of pixels for <ymin>, got '" + number + "'");
  }
  for (const auto& [content, fault] : cases) {
    EXPECT_THAT(voc_fault(annotation(object(sound) + object(content))),
                AllOf(StartsWith(fault), EndsWith(", in a.xml (object 2)")))
        << content;
  }
}

TEST(VocLabels, MarksThatAreNoMarksAreUnknown) {
  const auto marked = [](const std::string& marks) {
    return read_voc(annotation(object("<name>a</name>" + std::string(kBox) + marks)));
  };
  // Of an occlusion there is no share, so that half of one is neither 0 nor 1.
  const ImageLabels share =
      marked("<truncated>0.0625</truncated><occluded>0.5</occluded><difficult>True</difficult>");
  EXPECT_EQ(share.boxes.at(0).box,
            (Box{.xyxy = {0, 0, 30, 20}, .truncation = 0.0625f, .ignore = true}));
  EXPECT_THAT(share.remarks, IsEmpty());
  for (const char* value : {"2", "-1", "", "yes", "Unspecified", "nan"}) {
    const std::string text = value;
    const ImageLabels read =
        marked("<difficult>" + text + "</difficult><truncated>" + text + "</truncated>");
    EXPECT_EQ(read.boxes.at(0).box, (Box{.xyxy = {0, 0, 30, 20}})) << value;
    EXPECT_THAT(read.remarks, ElementsAre("<difficult> that is no 0 or 1 taken for unknown",
                                          "<truncated> that is no 0 or 1 taken for unknown"));
  }
}

TEST(VocLabels, EdgesCountFromWhereTheSetSays) {
  const auto box = [](int edges_from, const std::string& edges) {
    return read_voc(annotation(object("<name>a</name><bndbox>" + edges + "</bndbox>")), edges_from)
        .boxes.at(0)
        .box.xyxy;
  };
  const std::string edges = "<xmin>0</xmin><ymin>2.5</ymin><xmax>31</xmax><ymax>20</ymax>";
  EXPECT_EQ(box(1, edges), (Rectangle{-1, 1.5, 31, 20}));  // beyond the image: as other labels are
  EXPECT_EQ(box(0, edges), (Rectangle{0, 2.5, 31, 20}));
}

// The boxes lie beside the files in YOLO's form too, made of them by a program that took xmin for
// an edge: its left and top lie one pixel farther right and down than VOC's.
TEST(VocLabels, OfPedroAreThoseThatAnotherProgramRead) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto folder = data / "real_labels" / "pedro";
  if (!exists(folder)) GTEST_SKIP() << "skipped: no " << folder;
  std::size_t compared = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".xml") continue;
    const ImageLabels labels = read_voc(read_file(entry.path()));
    EXPECT_EQ(labels.size, (ImageSize{260, 346}));
    auto yolo = entry.path();
    std::ifstream lines(yolo.replace_extension(".txt"));
    for (const NamedBox& read : labels.boxes) {
      double number = 0, x = 0, y = 0, width = 0, height = 0;
      ASSERT_TRUE(lines >> number >> x >> y >> width >> height);
      EXPECT_EQ(read.class_name, "person");
      EXPECT_NEAR(read.box.xyxy.left, (x - width / 2) * 346 - 1, 1e-9);
      EXPECT_NEAR(read.box.xyxy.top, (y - height / 2) * 260 - 1, 1e-9);
      EXPECT_NEAR(read.box.xyxy.right, (x + width / 2) * 346, 1e-9);
      EXPECT_NEAR(read.box.xyxy.bottom, (y + height / 2) * 260, 1e-9);
      EXPECT_GE(read.box.truncation, 0);
      ++compared;
    }
    EXPECT_FALSE(lines >> std::ws && lines.peek() != EOF);
  }
  EXPECT_EQ(compared, 9u);
}

}  // namespace
}  // namespace eventgan

#include "manifests/files/input_file.h"
#include "stages/frames/events/recording_dataset.h"
#include "stages/frames/events/recording_labels.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/recordings/small_recording.h"

namespace eventgan {
namespace {

class WindowLabelsTest : public FolderTest {
 protected:
  RecordingLabels read(const std::string& text) const {
    write_file(file_, text);
    return WindowLabels().read(file_, ImageSize{100, 200}, 1.5);
  }

  fs::path file_ = at("yolo/train/a.txt");
};

TEST_F(WindowLabelsTest, AreSharesOfTheSensorAtTheWindowsTime) {
  const std::string text = "1 0.5 0.5 0.1 0.2\n0 0.25 0.5 0.5 1\n";
  const RecordingLabels labels = read(text);
  EXPECT_THAT(labels.class_names, ElementsAre("0", "1"));
  EXPECT_THAT(labels.annotations,
              ElementsAre(Pair(1.5, Annotation{text,
                                               {Box{.class_id = 1, .xyxy = {90, 40, 110, 60}},
                                                Box{.class_id = 0, .xyxy = {0, 0, 100, 100}}},
                                               {}})));
  EXPECT_THAT(read("").annotations.at(1.5).boxes, IsEmpty());
}

TEST_F(WindowLabelsTest, ClassesAreNamedBesideOrAboveThem) {
  EXPECT_THAT(WindowLabels().companions(file_), IsEmpty());
  write("yolo/classes.txt", "person\n");
  EXPECT_THAT(read("0 0.5 0.5 0.1 0.2").class_names, ElementsAre("person"));
  write("yolo/train/data.yaml", "names: [man, dog]\n");
  EXPECT_THAT(read("0 0.5 0.5 0.1 0.2").class_names, ElementsAre("man", "dog"));
  EXPECT_THAT(WindowLabels().companions(file_), ElementsAre(at("yolo/train/data.yaml")));
}

TEST_F(WindowLabelsTest, MistakesAreNamedByTheirLine) {
  EXPECT_THROWS(read("0 0.5 0.5 0.1 0.2\n0 0.5 nan 0.1 0.2\n"), InputError, "a.txt:2");
  EXPECT_THROWS(read("0 0.5 0.5 0.1\n"), InputError, "expected 5 columns, got 4");
}

TEST_F(WindowLabelsTest, OtherTextsAreNone) {
  for (const auto& [text, is] : {std::pair("", std::optional<bool>()),
                                 {"0 0.5 0.5 0.1 0.2\n", true},
                                 {"0 0.5 0.5 0.1 1.2\n", true},  // with a mistake, as below
                                 {"0 0.5 0.5 x 0.2\n", true},
                                 {"person 0.5 0.5 0.1 0.2\n", true},
                                 {"0 0.5 0.5 0.1\n0 0.5 0.5 0.1 0.2\n", false},
                                 {"2. walk in the park\n", false},
                                 {"3 persons walk past here\n", false},
                                 {"1 2 3 4 5\n", false},
                                 {"# x y w h\n0.1 0.2 0.3 0.4 0.5 0.6\n", false},
                                 {"0 0.5 0.5 0.1\n", false},
                                 {"recorded on a Monday\n", false},
                                 {"it was a sunny day\n", false},
                                 {"0.003811 96 133 0\n", false}}) {
    write_file(file_, text);
    EXPECT_EQ(is_window_label_text(file_), is) << text;
  }
}

/// Tables that are a window each.
class WindowTextsTest : public FolderTest {
 protected:
  WindowTextsTest() {
    spec_.dataset = DatasetKind::kRecording;
    spec_.root = "windows";
    spec_.recording.sensor = ImageSize{100, 100};
    for (const char* name : {"a.csv", "b.csv"}) text(name, "t,x,y,p\n0.1,1,2,1\n0.2,3,4,0\n");
  }

  void text(const std::string& name, const std::string& content) const {
    write("windows/" + name, content);
  }
  /// Boxes of these classes.
  void boxes(const std::string& name, const std::vector<int>& numbers) const {
    std::string lines;
    for (const int number : numbers) lines += std::to_string(number) + " 0.5 0.5 0.1 0.1\n";
    text(name, lines);
  }
  /// Of a window's boxes.
  std::vector<int> classes(std::size_t sample) const {
    std::vector<int> numbers;
    for (const Box& box : annotation_of(*open(), sample).boxes) numbers.push_back(box.class_id);
    return numbers;
  }
  Texts names() const { return open()->label_schema().class_names; }
  std::unique_ptr<Dataset> open() const { return open_recording_dataset(spec_, folder_.path()); }

  SourceSpec spec_;
};

TEST_F(WindowTextsTest, NumberTheirClassesAsYoloDoes) {
  boxes("a.txt", {10, 2});
  boxes("b.txt", {1});
  EXPECT_THAT(classes(0), ElementsAre(10, 2));
  EXPECT_THAT(classes(1), ElementsAre(1));
  EXPECT_THAT(names(), ElementsAre("0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10"));
  EXPECT_THAT(open()->notes(),
              Contains("classes are named by their numbers, since no data.yaml or classes.txt "
                       "with names is in windows or the folder above it"));
  spec_.root = "windows/a.csv";
  spec_.annotations = "windows/a.txt";
  EXPECT_THAT(open()->notes(), Contains(HasSubstr("with names is in windows")));
  spec_.root = "windows";
  spec_.annotations.reset();
  boxes("a.txt", {0});
  text("data.yaml", "names: [person, car]\n");
  EXPECT_THAT(classes(0), ElementsAre(0));
  EXPECT_THAT(names(), ElementsAre("person", "car"));
  EXPECT_THAT(open()->notes(), Each(HasSubstr("times are taken to count seconds")));
}

TEST_F(WindowTextsTest, AreLabelsOnlyIfOneSaysSo) {
  spec_.window.duration_s = 1;
  text("a.txt", "");  // a log that says nothing
  EXPECT_EQ(open()->labelled_frames().size(), 2u);
  EXPECT_THAT(open()->notes(), Contains(AllOf(HasSubstr("no labels, since its first line is not "
                                                        "YOLO's (class x y w h): "),
                                              HasSubstr("a.txt"))));
  fs::create_directory(at("windows/b.txt"));
  EXPECT_EQ(open()->labelled_frames().size(), 2u);
  fs::remove(at("windows/b.txt"));
  boxes("b.txt", {0});
  EXPECT_EQ(open()->labelled_frames().size(), 2u);
  EXPECT_THAT(classes(0), IsEmpty());
  EXPECT_THAT(classes(1), ElementsAre(0));
}

TEST_F(WindowTextsTest, WithAMistakeInTheFirstLineAreLabels) {
  boxes("b.txt", {0});
  text("a.txt", "0 0.5 0.5 0.1 1.2\n");
  EXPECT_THROWS(open(), InputError, "expected a share 0..1, got '1.2'", "windows/a.txt:1");
}

TEST_F(WindowTextsTest, OfATableWithoutEventsAreOfAStillScene) {
  text("b.csv", "t,x,y,p\n");
  boxes("a.txt", {0});
  boxes("b.txt", {1});
  for (const std::optional<double> duration_s : {std::optional<double>(), {0.1}}) {
    spec_.window.duration_s = duration_s;
    const auto dataset = open();
    EXPECT_THAT(ids_of(*dataset), ElementsAre("a/0000000000.200000", "b/0000000000.000000"));
    EXPECT_THAT(faults_of(*dataset), Each(""));
    const auto events = dataset->events(dataset->labelled_frames()[1].label_key);
    ASSERT_FALSE(is_fault(events)) << fault_of(events);
    EXPECT_THAT(events->events, IsEmpty());
    EXPECT_THAT(classes(1), ElementsAre(1));
    EXPECT_THAT(dataset->warnings(),
                ElementsAre("1 recording without events (1 empty event volume): windows/b.csv"));
  }
}

TEST_F(WindowTextsTest, AreOfTablesAlone) {
  boxes("a.txt", {0});
  testing::write_hdf5(at("drive.h5"), testing::small_mvsec());
  spec_.root = "drive.h5";
  spec_.recording.sensor.reset();
  spec_.annotations = "windows/a.txt";
  EXPECT_THROWS(open(), UsageError, "only a table");
}

TEST_F(WindowTextsTest, AreNamedInTheFolderAboveThatOfAnyPath) {
  boxes("a.txt", {1});
  write("data.yaml", "names: [person, car]\n");
  for (const char* root : {"windows", "windows/.", "./windows/"}) {
    spec_.root = root;
    EXPECT_THAT(names(), ElementsAre("person", "car")) << root;
    EXPECT_THAT(open()->annotation_files(), Contains("data.yaml")) << root;
  }
  spec_.root = ".";
  const auto in_folder = open_recording_dataset(spec_, at("windows"));
  EXPECT_THAT(in_folder->label_schema().class_names, ElementsAre("person", "car"));
  EXPECT_THAT(in_folder->annotation_files(), ElementsAre("../data.yaml", "a.txt"));
}

}  // namespace
}  // namespace eventgan


#include <limits>
#include <nlohmann/json.hpp>

#include "stages/frames/human36m/human36m_dataset.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/human36m/human36m_fixture.h"

namespace eventgan {
namespace {

using Datasets = std::map<std::string, testing::Hdf5Dataset>;

SourceSpec fetch_spec(const std::string& root) {
  SourceSpec spec;
  spec.dataset = DatasetKind::kHuman36m;
  spec.root = root;
  spec.layout = Human36mLayout::kFetch;
  return spec;
}

const std::string kWalking = "h36m/S1/Walking-1/", kSeventh = kWalking + "imageSequence/7/img_0000",
                  kKey = "S1/Walking-1/annot.h5#";

class FetchLayoutTest : public FolderTest {
 protected:
  void add_images(const std::string& camera, const std::vector<int>& numbers,
                  const std::string& action = "S1/Walking-1") const {
    for (const int number : numbers) {
      char name[32];
      std::snprintf(name, sizeof(name), "img_%06d.jpg", number);
      write("h36m/" + action + "/imageSequence/" + camera + "/" + name);
    }
  }
  void add_annotations(const Datasets& datasets, const std::string& action = "S1/Walking-1") const {
    testing::write_hdf5(at("h36m/" + action + "/annot.h5"), datasets);
  }
  std::unique_ptr<Dataset> open() const {
    return open_human36m_dataset(fetch_spec("h36m"), folder_.path());
  }
  nlohmann::json original(int row = 0) const {
    return nlohmann::json::parse(annotation_of(*open(), kKey + std::to_string(row)).original);
  }
};

TEST_F(FetchLayoutTest, GivesEveryRowAsASample) {
  add_images("7", {1, 6, 11});
  add_images("8", {1, 6});
  add_annotations(fetch_annotations({{8, 6}, {7, 11}, {7, 1}}));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("S1/Walking-1/7/000001", "S1/Walking-1/7/000011",
                                            "S1/Walking-1/8/000006"));
  EXPECT_EQ(text_of(frames[0]), "S1/Walking-1/7/000001 of S1/Walking-1/7: " + kSeventh +
                                    "01.jpg 1 by S1/Walking-1/annot.h5#2");
  EXPECT_EQ(dataset->label_place(frames[0].label_key), kWalking + "annot.h5#2");
  EXPECT_EQ(frames[0].frame.video_frame, -1);
  EXPECT_EQ(frames[0].frame.time_s, 0);
  EXPECT_EQ(frames[1].frame.time_s, 0.2);  // ten frames of a fiftieth of a second
  EXPECT_THAT(dataset->annotation_files(), ElementsAre(kWalking + "annot.h5"));
  EXPECT_THAT(dataset->label_schema().joint_names, ElementsAre("joint_0", "joint_1"));
  EXPECT_TRUE(dataset->label_schema().class_names.empty());
}

TEST_F(FetchLayoutTest, ReadsThePersonOfARow) {
  add_images("7", {1, 6});
  add_annotations(fetch_annotations({{7, 1}, {7, 6}}));
  const Annotation annotation = annotation_of(*open(), kKey + "1");
  EXPECT_TRUE(annotation.boxes.empty());
  ASSERT_EQ(annotation.persons.size(), 1u);
  const Person& person = annotation.persons[0];
  EXPECT_THAT(person.joints, ElementsAre(Joint{{100.25, 101.25}, -1}, Joint{{110.25, 111.25}, -1}));
  ASSERT_EQ(person.joints3d_mm.size(), 2u);
  EXPECT_EQ(person.joints3d_mm[1], (std::array{-1609.0, -2021.25, 5000.0}));
  // Of the joints: pixels 100.25 to 110.25 and 101.25 to 111.25.
  EXPECT_EQ(person.box, (Rectangle{100.25, 101.25, 111.25, 112.25}));
  EXPECT_EQ(person.center, (Point{105.25, 106.25}));
  EXPECT_DOUBLE_EQ(person.scale, 1.2 * 10 / 200);
  EXPECT_FALSE(person.head_box);
  // The file holds [fx, cx, fy, cy].
  EXPECT_EQ(person.camera, (Intrinsics{1250, 1000, 512.5, 515.5}));
  EXPECT_FALSE(person.distortion);
}

/// What h36m-fetch writes: joints as they are, and of a skeleton of universal size, here a tenth
/// larger about the camera, so that it projects alike: only the names tell which belong together.
Datasets present_annotations() {
  Datasets datasets = fetch_annotations({{7, 1}});
  datasets["pose/3d"] = datasets["pose/3d-univ"];
  auto& universal = std::get<std::vector<double>>(datasets["pose/3d-univ"].values);
  for (double& coordinate : universal) coordinate *= 1.1;
  datasets["intrinsics-univ/7"] = {{4}, std::vector<double>{1251, 512, 1001, 515}};
  return datasets;
}

TEST_F(FetchLayoutTest, TakesJointsInSpaceAndTheCameraThatWasFittedToThem) {
  const struct {
    Texts without;
    double z, focal;
    const char* what;
  } cases[] = {{{}, 5000, 1250, "pose/3d with intrinsics"},
               {{"pose/3d"}, 5500, 1251, "3d-univ with intrinsics-univ"},
               {{"intrinsics/7"}, 5500, 1251, "the other has no camera"},
               // As h36m-fetch wrote it at first.
               {{"pose/3d", "intrinsics-univ/7"}, 5500, 1250, "3d-univ with intrinsics"}};
  for (const auto& [without, z, focal, what] : cases) {
    SCOPED_TRACE(what);
    Datasets datasets = present_annotations();
    for (const std::string& name : without) datasets.erase(name);
    add_annotations(datasets);
    const auto dataset = open();
    EXPECT_THAT(dataset->notes(), IsEmpty());
    const Person person = annotation_of(*dataset).persons.at(0);
    EXPECT_EQ(person.joints3d_mm.at(0)->at(2), z);
    EXPECT_EQ(person.camera.value().focal_x, focal);
  }
}

TEST_F(FetchLayoutTest, OriginalHoldsBothCameras) {
  add_annotations(present_annotations());
  EXPECT_EQ(original()["intrinsics/7"][0], 1250);
  EXPECT_EQ(original()["intrinsics-univ/7"][0], 1251);
}

TEST_F(FetchLayoutTest, ACameraThatDoesNotProjectTheJointsIsNotClaimed) {
  Datasets datasets = fetch_annotations({{7, 1}, {7, 6}, {7, 11}});
  auto& joints3d = std::get<std::vector<double>>(datasets["pose/3d-univ"].values);
  // A pixel is 4 mm wide at 5 m, 5 mm high; so 19 px, and 15 and 20 px: 25 px.
  joints3d[0] += 4 * 19;
  joints3d[6] += 4 * 15;
  joints3d[7] += 5 * 20;
  add_annotations(datasets);
  const auto dataset = open();
  EXPECT_THAT(
      dataset->notes(),
      ElementsAre("no camera for 1 of 3 rows: by intrinsics/CAMERA and pose/3d-univ a joint "
                  "lies up to 25 px from where it is annotated (expected at most 20), in "
                  "h36m/S1/Walking-1/annot.h5"));
  const Person second = annotation_of(*dataset, 1).persons.at(0);
  EXPECT_TRUE(annotation_of(*dataset, 0).persons.at(0).camera);
  EXPECT_FALSE(second.camera);
  EXPECT_EQ(second.joints[1].at, (Point{110.25, 111.25}));
  EXPECT_EQ(second.joints3d_mm.size(), 2u);
  EXPECT_TRUE(annotation_of(*dataset, 2).persons.at(0).camera);
  // Behind the camera, where the same pixel comes out.
  for (int i = 12; i < 15; ++i) joints3d[static_cast<std::size_t>(i)] *= -1;
  add_annotations(datasets);
  EXPECT_THAT(open()->notes(), ElementsAre(HasSubstr("2 of 3 rows")));
}

TEST_F(FetchLayoutTest, OriginalHoldsEveryFieldOfTheRow) {
  add_images("7", {1, 6});
  auto datasets = fetch_annotations({{7, 1}, {7, 6}});
  datasets["pose/other"] = {{2, 1}, std::vector<double>{0.1, 1.0 / 3}};
  datasets["float"] = {{2}, std::vector<float>{0.5f, 0.1f}};
  datasets["odd"] = {{2}, std::vector<double>{1, std::numeric_limits<double>::quiet_NaN()}};
  datasets["action"] = {{2}, Texts{"walk", "stand"}};
  datasets["intrinsics/8"] = {{4}, std::vector<double>(4)};
  datasets["whole_file"] = {{3}, std::vector<double>(3)};
  add_annotations(datasets);
  const auto row = original(1);
  Texts names;
  for (const auto& field : row.items()) names.push_back(field.key());
  EXPECT_THAT(names, ElementsAre("action", "camera", "float", "frame", "intrinsics/7", "odd",
                                 "pose/2d", "pose/3d-univ", "pose/other"));
  EXPECT_EQ(row["action"], "stand");
  EXPECT_EQ(row["frame"], 6);
  EXPECT_EQ(row["pose/other"][0].get<double>(), 1.0 / 3) << "to the last bit";
  EXPECT_EQ(row["float"].get<float>(), 0.1f);
  EXPECT_TRUE(row["odd"].is_null());
  EXPECT_EQ(row["pose/2d"], nlohmann::json::parse("[[100.25, 101.25], [110.25, 111.25]]"));
  EXPECT_EQ(row["intrinsics/7"][1], 512.5);
}

TEST_F(FetchLayoutTest, RowsAsManyAsIntrinsicsAreNotMixedUp) {
  add_images("7", {1, 6, 11, 16});
  add_annotations(fetch_annotations({{7, 1}, {7, 6}, {7, 11}, {7, 16}}));
  EXPECT_EQ(original()["intrinsics/7"].size(), 4u);
}

TEST_F(FetchLayoutTest, PairedFramesCountFramesThatAreStoredOrLabelled) {
  add_images("7", {1, 6, 16, 21});  // 11 and 26 are labelled, but lost
  add_annotations(fetch_annotations({{7, 6}, {7, 11}, {7, 26}}));
  const auto dataset = open();
  EXPECT_THAT(paired(*dataset, 0, {-2, -1, 0, 1, 2, 3, 4, 5}),
              ElementsAre("beyond", "present " + kSeventh + "01.jpg 1",
                          "present " + kSeventh + "06.jpg 6", "missing " + kSeventh + "11.jpg 11",
                          "present " + kSeventh + "16.jpg 16", "present " + kSeventh + "21.jpg 21",
                          "missing " + kSeventh + "26.jpg 26", "beyond"));
  EXPECT_NEAR(dataset->paired_frame(dataset->labelled_frames()[0], 2).frame.time_s, 0.3, 1e-12);
}

TEST_F(FetchLayoutTest, FramesKeptAtIrregularTimesAreNotMissing) {
  // As h36m-fetch selects them: those at which a joint has moved by 40 mm.
  const std::vector<int> kept = {1, 14, 16, 17, 30};
  add_images("7", kept);
  add_annotations(fetch_annotations({{7, 1}, {7, 14}, {7, 16}, {7, 17}, {7, 30}}));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  for (int i = 0; i < 5; ++i) {
    for (int step = -i; step < 5 - i; ++step) {
      const PairedFrame found = dataset->paired_frame(frames[static_cast<std::size_t>(i)], step);
      EXPECT_EQ(found.state, State::kPresent);
      EXPECT_EQ(found.frame.index, kept[static_cast<std::size_t>(i + step)]);
    }
  }
  EXPECT_NEAR(dataset->paired_frame(frames[0], 1).frame.time_s - frames[0].frame.time_s, 13 / 50.0,
              1e-12);
}

TEST_F(FetchLayoutTest, RowsWithoutImageStayLabelled) {
  add_annotations(fetch_annotations({{7, 1}, {7, 6}}));
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 2u);
  EXPECT_THAT(paired(*dataset, 1, {-1, 0, 1}),
              ElementsAre("missing " + kSeventh + "01.jpg 1", "missing " + kSeventh + "06.jpg 6",
                          "beyond"));
}

TEST_F(FetchLayoutTest, TellsOfImagesWithoutLabelsAndCamerasWithoutIntrinsics) {
  for (const char* camera : {"7", "8", "9"}) add_images(camera, {1});
  add_images("7", {1}, "S5/Eating");
  add_annotations(fetch_annotations({{7, 1}, {8, 1}}));
  const auto dataset = open();
  EXPECT_THAT(dataset->notes(),
              ElementsAre("no intrinsics for camera 8, in h36m/S1/Walking-1/annot.h5",
                          "2 folders of images without labels, the first "
                          "h36m/S1/Walking-1/imageSequence/9"));
  EXPECT_FALSE(annotation_of(*dataset, kKey + "1").persons[0].camera);
}

TEST_F(FetchLayoutTest, FilesLeftOutAreCountedAndNamed) {
  add_images("7", {1, 6});
  touch(
      {kWalking + "imageSequence/7/img_000006.png", kWalking + "imageSequence/7/frame_000011.jpg"});
  add_annotations(fetch_annotations({{7, 1}}));
  EXPECT_THAT(open()->notes(), ElementsAre("2 files left out in h36m/S1/Walking-1/imageSequence/7: "
                                           "frame_000011.jpg, img_000006.jpg"));
}

TEST_F(FetchLayoutTest, ValuesThatAreNotFiniteAreAFaultOfTheirRow) {
  for (const std::string name : {"pose/2d", "pose/3d-univ", "intrinsics/7"}) {
    auto datasets = fetch_annotations({{7, 1}, {7, 6}});
    auto& values = std::get<std::vector<double>>(datasets.at(name).values);
    values.back() = std::numeric_limits<double>::quiet_NaN();
    add_annotations(datasets);
    const auto dataset = open();
    EXPECT_THAT(fault_of(*dataset, 1),
                AllOf(HasSubstr("expected finite"), HasSubstr("h36m/S1/Walking-1/annot.h5"),
                      HasSubstr(name)));
    if (name != "intrinsics/7") {
      EXPECT_EQ(fault_of(*dataset, 0), "no fault");
    }
  }
}

TEST_F(FetchLayoutTest, UnknownLabelKeysAreFaults) {
  add_annotations(fetch_annotations({{7, 1}}));
  const auto dataset = open();
  for (const char* key :
       {"", "#", "S1/Walking-1/annot.h5", "S1/Walking-1/annot.h5#", "S1/Walking-1/annot.h5#1",
        "S1/Walking-1/annot.h5#-1", "S1/Walking-1/annot.h5#0x", "S2/Walking-1/annot.h5#0"}) {
    EXPECT_THAT(fault_of(dataset->annotation(key)), HasSubstr(", in h36m"));
  }
}

TEST_F(FetchLayoutTest, RefusesMissingAndMisshapenDatasets) {
  const Datasets misshapen = {{"pose/2d", {{2, 4}, std::vector<double>(8)}},
                              {"pose/3d-univ", {{2, 2, 2}, std::vector<double>(8)}},
                              {"camera", {{3}, std::vector<std::int64_t>(3)}},
                              {"frame", {{2}, Texts{"1", "6"}}},
                              {"intrinsics/7", {{5}, std::vector<double>(5)}}};
  for (const auto& [name, dataset] : misshapen) {
    auto datasets = fetch_annotations({{7, 1}, {7, 6}});
    const std::string place = "(" + name + ")";
    datasets[name] = dataset;
    add_annotations(datasets);
    EXPECT_THROWS(open(), InputError, "expected numbers [", "annot.h5", place);
    datasets.erase(name);
    add_annotations(datasets);
    if (name == "intrinsics/7") continue;  // may be absent
    EXPECT_THROWS(open(), InputError, "no such array", place);
  }
}

TEST_F(FetchLayoutTest, RefusesOddNumbersAndFilesAndDoubleRows) {
  auto datasets = fetch_annotations({{7, 1}});
  for (const double frame : {-1.0, 1.5, 1e9, std::nan("")}) {
    datasets["frame"] = {{1}, std::vector<double>{frame}};
    add_annotations(datasets);
    EXPECT_THROWS(open(), InputError, "(frame, row 0)");
  }
  add_annotations(fetch_annotations({{7, 1}, {7, 6}, {7, 1}}));
  EXPECT_THROWS(open(), InputError, "annot.h5#0 and S1/Walking-1/annot.h5#2",
                "(S1/Walking-1/7/000001)");
  write_file(folder_ / "h36m/S1/Walking-1/annot.h5", "no HDF5");
  EXPECT_THROWS(open(), InputError, "S1/Walking-1/annot.h5");
}

TEST_F(FetchLayoutTest, RefusesFilesOfDifferentJoints) {
  add_annotations(fetch_annotations({{7, 1}}));
  add_annotations({{"pose/2d", {{1, 3, 2}, std::vector<double>(6)}},
                   {"pose/3d-univ", {{1, 3, 3}, std::vector<double>(9)}},
                   {"camera", {{1}, std::vector<std::int64_t>{7}}},
                   {"frame", {{1}, std::vector<std::int64_t>{1}}}},
                  "S2/Walking-1");
  EXPECT_THROWS(open(), InputError, "expected 2 joints as in the files before, got 3");
}

TEST_F(FetchLayoutTest, RefusesRootsWithNothingIn) {
  EXPECT_THROWS(open(), InputError, "h36m");
  fs::create_directories(at("h36m/S1/Walking-1"));
  EXPECT_THROWS(open(), InputError, "annot.h5 files, got none, in h36m");
  SourceSpec spec = fetch_spec("h36m");
  spec.layout.reset();
  EXPECT_THROWS(open_human36m_dataset(spec, folder_.path()), UsageError, "layout");
}

TEST_F(FetchLayoutTest, ReadsSharedData) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto dataset = open_human36m_dataset(fetch_spec("human36m_fetch"), data);
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 18u);  // two cameras, nine frames each
  EXPECT_EQ(frames[1].sample_id, "S1/Directions-1/54138969/000006");
  // Its joints and intrinsics are random numbers.
  EXPECT_THAT(dataset->notes(), ElementsAre(AllOf(HasSubstr("no camera for 18 of 18 rows"),
                                                  HasSubstr("Directions-1/annot.h5"))));
  EXPECT_EQ(dataset->label_schema().joint_names.size(), 32u);
  for (std::size_t i = 0; i < 18; ++i) {
    EXPECT_THAT(paired(*dataset, i, {0}), ElementsAre("present " + text_of(frames[i].frame)));
    EXPECT_TRUE(fs::exists(data / frames[i].frame.path));
    EXPECT_EQ(fault_of(*dataset, i), "no fault");
  }
  EXPECT_THAT(paired(*dataset, 0, {6, 9}), ElementsAre(EndsWith(" 31"), "beyond"));
  EXPECT_FALSE(annotation_of(*dataset, 17).persons[0].camera);
}

}  // namespace
}  // namespace eventgan

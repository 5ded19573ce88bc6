#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "stages/frames/human36m/human36m_dataset.h"
#include "tests/stages/frames/human36m/human36m_fixture.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using State = PairedFrame::State;
using Datasets = std::map<std::string, testing::Hdf5Dataset>;

SourceSpec fetch_spec(const std::string& root) {
  SourceSpec spec;
  spec.dataset = DatasetKind::kHuman36m;
  spec.root = root;
  spec.layout = Human36mLayout::kFetch;
  return spec;
}

class FetchLayoutTest : public ::testing::Test {
 protected:
  void add_images(const std::string& camera, const std::vector<int>& numbers,
                  const std::string& action = "S1/Walking-1") {
    for (const int number : numbers) {
      char name[32];
      std::snprintf(name, sizeof(name), "img_%06d.jpg", number);
      testing::write_file(folder_ / "h36m" / action / "imageSequence" / camera / name, "");
    }
  }
  void add_annotations(const Datasets& datasets, const std::string& action = "S1/Walking-1") {
    testing::write_hdf5(folder_ / "h36m" / action / "annot.h5", datasets);
  }
  std::unique_ptr<Dataset> open() {
    return open_human36m_dataset(fetch_spec("h36m"), folder_.path());
  }

  testing::TemporaryFolder folder_;
};

TEST_F(FetchLayoutTest, GivesEveryRowAsASample) {
  add_images("7", {1, 6, 11});
  add_images("8", {1, 6});
  add_annotations(fetch_annotations({{8, 6}, {7, 11}, {7, 1}}));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].sample_id, "S1/Walking-1/7/000001");
  EXPECT_EQ(frames[0].sequence, "S1/Walking-1/7");
  EXPECT_EQ(frames[0].label_key, "S1/Walking-1/annot.h5#2");
  EXPECT_EQ(dataset->label_place(frames[0].label_key), "h36m/S1/Walking-1/annot.h5#2");
  EXPECT_EQ(frames[0].frame.path, "h36m/S1/Walking-1/imageSequence/7/img_000001.jpg");
  EXPECT_EQ(frames[0].frame.index, 1);
  EXPECT_EQ(frames[0].frame.video_frame, -1);
  EXPECT_EQ(frames[0].frame.time_s, 0);
  EXPECT_EQ(frames[1].sample_id, "S1/Walking-1/7/000011");
  EXPECT_EQ(frames[1].frame.time_s, 0.2);  // ten frames of a fiftieth of a second
  EXPECT_EQ(frames[2].sample_id, "S1/Walking-1/8/000006");
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("h36m/S1/Walking-1/annot.h5"));
  EXPECT_THAT(dataset->label_schema().joint_names, ElementsAre("joint_0", "joint_1"));
  EXPECT_TRUE(dataset->label_schema().class_names.empty());
}

TEST_F(FetchLayoutTest, ReadsThePersonOfARow) {
  add_images("7", {1, 6});
  add_annotations(fetch_annotations({{7, 1}, {7, 6}}));
  const auto dataset = open();
  const auto outcome = dataset->annotation("S1/Walking-1/annot.h5#1");
  ASSERT_FALSE(is_fault(outcome)) << outcome.fault().reason;
  const Annotation& annotation = *outcome;
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

Person only_person(const Dataset& dataset) {
  const auto outcome = dataset.annotation("S1/Walking-1/annot.h5#0");
  EXPECT_FALSE(is_fault(outcome));
  return outcome->persons.at(0);
}

TEST_F(FetchLayoutTest, TakesJointsInSpaceAndTheCameraThatWasFittedToThem) {
  const auto z_and_focal = [&](const Datasets& datasets) {
    add_annotations(datasets);
    const auto dataset = open();
    EXPECT_THAT(dataset->notes(), ::testing::IsEmpty());
    const Person person = only_person(*dataset);
    return std::pair(person.joints3d_mm.at(0)->at(2), person.camera.value().focal_x);
  };
  const Datasets present = present_annotations();
  EXPECT_EQ(z_and_focal(present), std::pair(5000.0, 1250.0)) << "pose/3d with intrinsics";

  Datasets universal = present;
  universal.erase("pose/3d");
  EXPECT_EQ(z_and_focal(universal), std::pair(5500.0, 1251.0)) << "3d-univ with intrinsics-univ";
  universal["pose/3d"] = present.at("pose/3d");
  universal.erase("intrinsics/7");
  EXPECT_EQ(z_and_focal(universal), std::pair(5500.0, 1251.0)) << "the other has no camera";

  Datasets old = present;  // as h36m-fetch wrote it at first
  old.erase("pose/3d");
  old.erase("intrinsics-univ/7");
  EXPECT_EQ(z_and_focal(old), std::pair(5500.0, 1250.0)) << "3d-univ with intrinsics";
}

TEST_F(FetchLayoutTest, OriginalHoldsBothCameras) {
  add_annotations(present_annotations());
  const auto outcome = open()->annotation("S1/Walking-1/annot.h5#0");
  const auto original = nlohmann::json::parse(outcome->original);
  EXPECT_EQ(original["intrinsics/7"][0], 1250);
  EXPECT_EQ(original["intrinsics-univ/7"][0], 1251);
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
  const auto person = [&](int row) {
    const auto outcome = dataset->annotation("S1/Walking-1/annot.h5#" + std::to_string(row));
    return outcome->persons.at(0);
  };
  EXPECT_TRUE(person(0).camera);
  EXPECT_FALSE(person(1).camera);
  EXPECT_EQ(person(1).joints[1].at, (Point{110.25, 111.25}));
  EXPECT_EQ(person(1).joints3d_mm.size(), 2u);
  EXPECT_TRUE(person(2).camera);

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
  datasets["action"] = {{2}, std::vector<std::string>{"walk", "stand"}};
  datasets["intrinsics/8"] = {{4}, std::vector<double>(4)};
  datasets["whole_file"] = {{3}, std::vector<double>(3)};
  add_annotations(datasets);
  const auto outcome = open()->annotation("S1/Walking-1/annot.h5#1");
  const auto original = nlohmann::json::parse(outcome->original);
  std::vector<std::string> names;
  for (const auto& field : original.items()) names.push_back(field.key());
  EXPECT_THAT(names, ElementsAre("action", "camera", "float", "frame", "intrinsics/7", "odd",
                                 "pose/2d", "pose/3d-univ", "pose/other"));
  EXPECT_EQ(original["action"], "stand");
  EXPECT_EQ(original["frame"], 6);
  EXPECT_EQ(original["pose/other"][0].get<double>(), 1.0 / 3) << "to the last bit";
  EXPECT_EQ(original["float"].get<float>(), 0.1f);
  EXPECT_TRUE(original["odd"].is_null());
  EXPECT_EQ(original["pose/2d"], nlohmann::json::parse("[[100.25, 101.25], [110.25, 111.25]]"));
  EXPECT_EQ(original["intrinsics/7"][1], 512.5);
}

TEST_F(FetchLayoutTest, RowsAsManyAsIntrinsicsAreNotMixedUp) {
  add_images("7", {1, 6, 11, 16});
  add_annotations(fetch_annotations({{7, 1}, {7, 6}, {7, 11}, {7, 16}}));
  const auto outcome = open()->annotation("S1/Walking-1/annot.h5#0");
  const auto original = nlohmann::json::parse(outcome->original);
  EXPECT_EQ(original["intrinsics/7"].size(), 4u);
}

TEST_F(FetchLayoutTest, PairedFramesCountFramesThatAreStoredOrLabelled) {
  add_images("7", {1, 6, 16, 21});  // 11 and 26 are labelled, but lost
  add_annotations(fetch_annotations({{7, 6}, {7, 11}, {7, 26}}));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames[0].frame.index, 6);
  const PairedFrame before = dataset->paired_frame(frames[0], -1);
  EXPECT_EQ(before.state, State::kPresent);
  EXPECT_EQ(before.frame.index, 1);
  EXPECT_EQ(before.frame.path, "h36m/S1/Walking-1/imageSequence/7/img_000001.jpg");
  EXPECT_EQ(dataset->paired_frame(frames[0], 0).state, State::kPresent);
  const PairedFrame missing = dataset->paired_frame(frames[0], 1);
  EXPECT_EQ(missing.state, State::kMissing);
  EXPECT_EQ(missing.frame.path, "h36m/S1/Walking-1/imageSequence/7/img_000011.jpg");
  EXPECT_EQ(dataset->paired_frame(frames[0], 2).frame.index, 16);
  EXPECT_NEAR(dataset->paired_frame(frames[0], 2).frame.time_s, 0.3, 1e-12);
  EXPECT_EQ(dataset->paired_frame(frames[0], 4).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(frames[0], 4).frame.index, 26);
  EXPECT_EQ(dataset->paired_frame(frames[0], 5).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frames[0], -2).state, State::kBeyond);
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
  const PairedFrame itself = dataset->paired_frame(dataset->labelled_frames()[1], 0);
  EXPECT_EQ(itself.state, State::kMissing);
  EXPECT_EQ(itself.frame.path, "h36m/S1/Walking-1/imageSequence/7/img_000006.jpg");
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[1], -1).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[1], 1).state, State::kBeyond);
}

TEST_F(FetchLayoutTest, TellsOfImagesWithoutLabelsAndCamerasWithoutIntrinsics) {
  add_images("7", {1});
  add_images("8", {1});
  add_images("9", {1});
  add_images("7", {1}, "S5/Eating");
  add_annotations(fetch_annotations({{7, 1}, {8, 1}}));
  const auto dataset = open();
  EXPECT_THAT(dataset->notes(),
              ElementsAre("no intrinsics for camera 8, in h36m/S1/Walking-1/annot.h5",
                          "2 folders of images without labels, the first "
                          "h36m/S1/Walking-1/imageSequence/9"));
  const auto outcome = dataset->annotation("S1/Walking-1/annot.h5#1");
  EXPECT_FALSE(outcome->persons[0].camera);
}

TEST_F(FetchLayoutTest, FilesLeftOutAreCountedAndNamed) {
  add_images("7", {1, 6});
  const auto camera = folder_ / "h36m/S1/Walking-1/imageSequence/7";
  testing::write_file(camera / "img_000006.png", "");
  testing::write_file(camera / "frame_000011.jpg", "");
  add_annotations(fetch_annotations({{7, 1}}));
  EXPECT_THAT(open()->notes(), ElementsAre("2 files left out in h36m/S1/Walking-1/imageSequence/7: "
                                           "frame_000011.jpg, img_000006.jpg"));
}

TEST_F(FetchLayoutTest, ValuesThatAreNotFiniteAreAFaultOfTheirRow) {
  for (const char* name : {"pose/2d", "pose/3d-univ", "intrinsics/7"}) {
    auto datasets = fetch_annotations({{7, 1}, {7, 6}});
    auto& values = std::get<std::vector<double>>(datasets.at(name).values);
    values.back() = std::numeric_limits<double>::quiet_NaN();
    add_annotations(datasets);
    const auto dataset = open();
    const auto outcome = dataset->annotation("S1/Walking-1/annot.h5#1");
    ASSERT_TRUE(is_fault(outcome)) << name;
    EXPECT_THAT(outcome.fault().reason,
                AllOf(HasSubstr("expected finite"), HasSubstr("h36m/S1/Walking-1/annot.h5"),
                      HasSubstr(name)));
    if (std::string(name) != "intrinsics/7") {
      EXPECT_FALSE(is_fault(dataset->annotation("S1/Walking-1/annot.h5#0")));
    }
  }
}

TEST_F(FetchLayoutTest, UnknownLabelKeysAreFaults) {
  add_annotations(fetch_annotations({{7, 1}}));
  const auto dataset = open();
  for (const char* key :
       {"", "#", "S1/Walking-1/annot.h5", "S1/Walking-1/annot.h5#", "S1/Walking-1/annot.h5#1",
        "S1/Walking-1/annot.h5#-1", "S1/Walking-1/annot.h5#0x", "S2/Walking-1/annot.h5#0"}) {
    const auto outcome = dataset->annotation(key);
    ASSERT_TRUE(is_fault(outcome)) << key;
    EXPECT_THAT(outcome.fault().reason, HasSubstr(", in h36m"));
  }
}

TEST_F(FetchLayoutTest, RefusesMissingAndMisshapenDatasets) {
  const auto valid = fetch_annotations({{7, 1}, {7, 6}});
  const std::map<std::string, testing::Hdf5Dataset> misshapen = {
      {"pose/2d", {{2, 4}, std::vector<double>(8)}},
      {"pose/3d-univ", {{2, 2, 2}, std::vector<double>(8)}},
      {"camera", {{3}, std::vector<std::int64_t>(3)}},
      {"frame", {{2}, std::vector<std::string>{"1", "6"}}},
      {"intrinsics/7", {{5}, std::vector<double>(5)}}};
  for (const auto& [name, dataset] : misshapen) {
    auto datasets = valid;
    datasets[name] = dataset;
    add_annotations(datasets);
    EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(AllOf(HasSubstr("expected numbers ["),
                                                                 HasSubstr("annot.h5"),
                                                                 HasSubstr("(" + name + ")"))));
    datasets.erase(name);
    add_annotations(datasets);
    if (name == "intrinsics/7") continue;  // may be absent
    EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(AllOf(HasSubstr("no such array"),
                                                                 HasSubstr("(" + name + ")"))));
  }
}

TEST_F(FetchLayoutTest, RefusesOddNumbersAndFilesAndDoubleRows) {
  auto datasets = fetch_annotations({{7, 1}});
  for (const double frame : {-1.0, 1.5, 1e9, std::nan("")}) {
    datasets["frame"] = {{1}, std::vector<double>{frame}};
    add_annotations(datasets);
    EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("(frame, row 0)")));
  }
  add_annotations(fetch_annotations({{7, 1}, {7, 6}, {7, 1}}));
  EXPECT_THAT([&] { open(); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("annot.h5#0 and S1/Walking-1/annot.h5#2"),
                                              HasSubstr("(S1/Walking-1/7/000001)"))));
  testing::write_file(folder_ / "h36m/S1/Walking-1/annot.h5", "no HDF5");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("S1/Walking-1/annot.h5")));
}

TEST_F(FetchLayoutTest, RefusesFilesOfDifferentJoints) {
  add_annotations(fetch_annotations({{7, 1}}));
  add_annotations({{"pose/2d", {{1, 3, 2}, std::vector<double>(6)}},
                   {"pose/3d-univ", {{1, 3, 3}, std::vector<double>(9)}},
                   {"camera", {{1}, std::vector<std::int64_t>{7}}},
                   {"frame", {{1}, std::vector<std::int64_t>{1}}}},
                  "S2/Walking-1");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(
                                   HasSubstr("expected 2 joints as in the files before, got 3")));
}

TEST_F(FetchLayoutTest, RefusesRootsWithNothingIn) {
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("h36m")));
  std::filesystem::create_directories(folder_ / "h36m/S1/Walking-1");
  EXPECT_THAT([&] { open(); },
              ThrowsMessage<InputError>(HasSubstr("annot.h5 files, got none, in h36m")));
  SourceSpec spec = fetch_spec("h36m");
  spec.layout.reset();
  EXPECT_THROW(open_human36m_dataset(spec, folder_.path()), UsageError);
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
  for (const LabelledFrame& frame : frames) {
    EXPECT_EQ(dataset->paired_frame(frame, 0).state, State::kPresent);
    EXPECT_TRUE(std::filesystem::exists(data / frame.frame.path));
    EXPECT_FALSE(is_fault(dataset->annotation(frame.label_key)));
  }
  EXPECT_EQ(dataset->paired_frame(frames[0], 6).frame.index, 31);
  EXPECT_EQ(dataset->paired_frame(frames[0], 9).state, State::kBeyond);
  const auto outcome = dataset->annotation(frames[17].label_key);
  EXPECT_FALSE(outcome->persons[0].camera);
}

}  // namespace
}  // namespace eventgan

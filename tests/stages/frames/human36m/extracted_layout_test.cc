#include "stages/frames/human36m/detail/extracted_layout.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/labels/label_mapping.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

TEST(ExtractedNameTest, ReadsABareNameAndTakesTheFolderFromAPath) {
  const ExtractedName name = parse_extracted_name("S11_SittingDown 1.54138969_002061.jpg");
  EXPECT_EQ(name.folder, "S11/S11_SittingDown 1.54138969");
  EXPECT_EQ(name.sequence, "S11_SittingDown 1.54138969");
  EXPECT_EQ(name.subject, "S11");
  EXPECT_EQ(name.camera, "54138969");
  EXPECT_EQ(name.number, 2061);
  EXPECT_EQ(parse_extracted_name("images/S1_A.7_000001.jpg").folder, "images");
  EXPECT_EQ(parse_extracted_name("./a//b/S1_A.7_000001.jpg").folder, "a/b");
}

TEST(ExtractedNameTest, RefusesOtherNames) {
  for (const char* name :
       {"", "S1_A.7", "S1_A.7_.jpg", "S1_A.7_00000a.jpg", "S1_A_000001.jpg", "S1_A.x_000001.jpg",
        "S1_A._000001.jpg", "_A.7_000001.jpg", "S1.7_000001.jpg", "S1_A.7_0000000001.jpg",
        "/S1/S1_A.7_000001.jpg", "../S1_A.7_000001.jpg", "a/../S1_A.7_000001.jpg"}) {
    EXPECT_THROWS(parse_extracted_name(name), std::invalid_argument, "expected") << name;
  }
}

const std::string kVideo = "S1_Walking_1.7", kFirst = kVideo + "_000001.jpg",
                  kSixth = kVideo + "_000006.jpg", kFolder = "S1/" + kVideo + "/";

SourceSpec extracted_spec(const std::string& root) {
  SourceSpec spec;
  spec.dataset = DatasetKind::kHuman36m;
  spec.root = root;
  spec.layout = Human36mLayout::kExtracted;
  return spec;
}

/// The members of an .npz. In row r of J joints, joint j lies at (10 r + j, 10 r + j + 0.5), with
/// confidence unless it is joint 1, and at (0.001 j, 0.002, 5) m.
std::map<std::string, std::string> members(const Texts& names, std::size_t joints = 17) {
  std::vector<double> center, scale, part, pose;
  for (std::size_t r = 0; r < names.size(); ++r) {
    const auto row = static_cast<double>(r);
    center.insert(center.end(), {500 + row, 400});
    scale.push_back(2 + row);
    for (std::size_t j = 0; j < joints; ++j) {
      const auto joint = static_cast<double>(j);
      part.insert(part.end(), {10 * row + joint, 10 * row + joint + 0.5, j == 1 ? 0.0 : 1.0});
      pose.insert(pose.end(), {0.001 * joint, 0.002, 5, 1});
    }
  }
  return {{"imgname", testing::npy_strings(names)},
          {"center", testing::npy_doubles({names.size(), 2}, center)},
          {"scale", testing::npy_doubles({names.size()}, scale)},
          {"part", testing::npy_doubles({names.size(), joints, 3}, part)},
          {"S", testing::npy_doubles({names.size(), joints, 4}, pose)}};
}

class ExtractedLayoutTest : public FolderTest {
 protected:
  ExtractedLayoutTest() { fs::create_directories(at("h36m")); }

  void add_images(const Texts& paths) const {
    for (const std::string& path : paths) write("h36m/" + path);
  }
  void add_npz(const std::map<std::string, std::string>& arrays,
               const std::string& name = "h36m/a.npz") const {
    std::vector<testing::ZipMember> zip;
    for (const auto& [array, bytes] : arrays) zip.push_back({array + ".npy", bytes, true});
    testing::write_zip(at(name), zip);
  }
  std::unique_ptr<Dataset> open() const { return open_human36m_dataset(spec_, folder_.path()); }

  SourceSpec spec_ = extracted_spec("h36m");
};

TEST_F(ExtractedLayoutTest, GivesEveryRowAsASample) {
  add_images({kFolder + kFirst, kFolder + kSixth, kFolder + kVideo + "_000016.jpg",
              kFolder + kVideo + "_000006_mask.png"});
  add_npz(members({kSixth, kFolder + kFirst}));  // a bare name and a path
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 2u);
  const std::string path = "h36m/" + kFolder + kVideo;
  EXPECT_EQ(text_of(frames[0]),
            kVideo + "_000001 of " + kVideo + ": " + path + "_000001.jpg 1 by a.npz#1");
  EXPECT_EQ(dataset->label_place("a.npz#1"), "h36m/a.npz#1");
  EXPECT_EQ(frames[1].frame.time_s, 0.1);  // five frames of a fiftieth of a second
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("h36m/a.npz"));
  EXPECT_THAT(paired(*dataset, 1, {-1, 0, 1, 2}),
              ElementsAre("present " + path + "_000001.jpg 1", "present " + path + "_000006.jpg 6",
                          "present " + path + "_000016.jpg 16", "beyond"));
}

TEST_F(ExtractedLayoutTest, ReadsThePersonOfARow) {
  add_npz(members({kFirst, kSixth}));
  const auto dataset = open();
  EXPECT_EQ(dataset->label_schema().joint_names.at(16), "right_wrist");
  const Person person = annotation_of(*dataset, "a.npz#1").persons.at(0);
  ASSERT_EQ(person.joints.size(), 17u);
  EXPECT_EQ(person.joints[0], (Joint{{10, 10.5}, -1})) << "Human3.6M annotates no visibility";
  EXPECT_EQ(person.joints[1], (Joint{{11, 11.5}, 0})) << "a place without confidence";
  EXPECT_EQ(person.center, (Point{501, 400}));
  EXPECT_EQ(person.scale, 3);
  EXPECT_TRUE(person.box);
  EXPECT_FALSE(person.camera);
  EXPECT_THAT(person.joints3d_mm.at(3), Optional(ElementsAre(::testing::DoubleEq(3), 2, 5000)));
}

TEST_F(ExtractedLayoutTest, JointsInSpaceWithoutConfidenceAreUnknown) {
  auto arrays = members({kFirst, kSixth}, 2);
  arrays["S"] = testing::npy_doubles({2, 2, 4}, {0, 0, 0, 0, 0.5, 0.25, 4, 1,  //
                                                 1, 1, 5, 0, 0, 0, 0, 0});
  add_npz(arrays);
  spec_.annotations = "h36m/a.npz";
  EXPECT_THAT(annotation_of(*open(), "a.npz#0").persons.at(0).joints3d_mm,
              ElementsAre(std::nullopt, Optional(std::array{500.0, 250.0, 4000.0})));
  EXPECT_THAT(annotation_of(*open(), "a.npz#1").persons.at(0).joints3d_mm, IsEmpty());
}

TEST_F(ExtractedLayoutTest, JointsWithoutAnnotationAreMissing) {
  auto arrays = members({kFirst}, 2);
  arrays["part"] = testing::npy_doubles({1, 2, 3}, {0, 0, 0, 0, 0, 1});
  add_npz(arrays);
  spec_.annotations = "h36m/a.npz";
  EXPECT_THAT(annotation_of(*open()).persons.at(0).joints,
              ElementsAre(Joint{kMissingPoint, 0}, Joint{{0, 0}, -1}));
}

TEST_F(ExtractedLayoutTest, OriginalHoldsEveryFieldOfTheRow) {
  auto arrays = members({kFirst, kSixth});
  arrays["pose"] =
      testing::npy_doubles({2, 2}, {0, 0, 1.0 / 3, std::numeric_limits<double>::infinity()});
  arrays["mean"] = testing::npy_doubles({3}, {1, 2, 3});
  arrays["keep"] = testing::npy_file("{'descr': '|b1', 'fortran_order': False, 'shape': (2,)}",
                                     std::string("\0\1", 2));
  arrays["gender"] =
      testing::npy_file("{'descr': '|O', 'fortran_order': False, 'shape': (2,)}", "\x80.");
  add_npz(arrays);
  const auto dataset = open();
  const auto original = nlohmann::json::parse(annotation_of(*dataset, "a.npz#1").original);
  Texts names;
  for (const auto& field : original.items()) names.push_back(field.key());
  EXPECT_THAT(names, ElementsAre("S", "center", "imgname", "keep", "part", "pose", "scale"));
  EXPECT_EQ(original["imgname"], kSixth);
  EXPECT_EQ(original["keep"], true);
  EXPECT_EQ(original["pose"][0].get<double>(), 1.0 / 3) << "to the last bit";
  EXPECT_TRUE(original["pose"][1].is_null());
  EXPECT_EQ(original["part"].size(), 17u);
  EXPECT_THAT(dataset->notes(),
              Contains(AllOf(HasSubstr("array gender is left out"), HasSubstr("Python objects"))));
}

TEST_F(ExtractedLayoutTest, ChoosesTheOnlyFileThatFits) {
  add_npz(members({kFirst}));
  add_npz(members({kFirst}, 24), "h36m/b.npz");
  write_file(folder_ / "h36m/c.npz", "no zip file");
  EXPECT_EQ(open()->labelled_frames()[0].label_key, "a.npz#0");
  EXPECT_THAT(open()->notes(),
              Contains(AllOf(
                  HasSubstr("2 annotation files left out beside h36m/a.npz: b.npz (not usable: "),
                  HasSubstr("), c.npz (not usable: expected "))));

  add_npz(members({kFirst}), "h36m/d.npz");
  EXPECT_THROWS(open(), UsageError, "\"annotations\"", "got 2",
                "; there is a.npz, b.npz (not usable: expected part of shape "
                "[N, 17, 3], got [1, 24, 3]), c.npz (not usable: expected ",
                "), d.npz");
  spec_.annotations = "h36m/b.npz";
  const auto dataset = open();
  EXPECT_EQ(dataset->label_schema().joint_names.at(23), "joint_23");
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("h36m/b.npz"));
}

TEST_F(ExtractedLayoutTest, AsksForAnnotationsWhereNoneFit) {
  EXPECT_THROWS(open(), InputError, "\"annotations\"");
  write("h36m/c.npz", "no zip file");
  EXPECT_THROWS(open(), InputError, "there is c.npz (not usable: expected ");
  fs::remove(at("h36m/c.npz"));
  auto without_scale = members({kFirst});
  without_scale.erase("scale");
  add_npz(without_scale);
  EXPECT_THROWS(open(), InputError, "a.npz (not usable: expected an array scale, got none)");
  spec_.annotations = "absent.npz";
  EXPECT_THROWS(open(), InputError, "absent.npz");
  spec_ = extracted_spec("elsewhere");
  EXPECT_THROWS(open(), InputError, "expected a folder", "in elsewhere");
}

TEST_F(ExtractedLayoutTest, RefusesMissingAndMisshapenArrays) {
  spec_.annotations = "h36m/a.npz";
  const std::map<std::string, std::string> misshapen = {
      {"imgname", testing::npy_doubles({1}, {1})},
      {"center", testing::npy_doubles({1, 3}, {1, 2, 3})},
      {"scale", testing::npy_doubles({1, 1}, {1})},
      {"part", testing::npy_doubles({1, 17, 2}, std::vector<double>(34))},
      {"S", testing::npy_doubles({1, 16, 4}, std::vector<double>(64))}};
  for (const auto& [name, bytes] : misshapen) {
    auto arrays = members({kFirst});
    const std::string place = "(" + name + ")";
    arrays[name] = bytes;
    add_npz(arrays);
    EXPECT_THROWS(open(), InputError, "h36m/a.npz", place);
    arrays[name] = bytes.substr(0, bytes.size() - 1);
    add_npz(arrays);
    EXPECT_THROWS(open(), InputError, place);
    arrays.erase(name);
    add_npz(arrays);
    EXPECT_THROWS(open(), InputError, "no such array", place);
  }
}

TEST_F(ExtractedLayoutTest, RefusesNamesItCannotPlace) {
  spec_.annotations = "h36m/a.npz";
  for (const auto& [second, words] :
       {std::pair("image.jpg"s, "got \"image.jpg\", in h36m/a.npz (imgname, row 1)"),
        {kFirst, "a.npz#0 and a.npz#1"},
        {"x/" + kSixth, "in one folder"}}) {
    add_npz(members({kFirst, second}));
    EXPECT_THROWS(open(), InputError, words);
  }
}

TEST_F(ExtractedLayoutTest, ValuesThatAreNotFiniteAreAFaultOfTheirRow) {
  for (const char* name : {"part", "S", "center", "scale"}) {
    auto arrays = members({kFirst, kSixth});
    // The last double becomes a quiet NaN, 0x7ff8 in its two highest bytes.
    arrays[name].replace(arrays[name].size() - 2, 2, "\xf8\x7f");
    add_npz(arrays);
    const auto dataset = open();
    EXPECT_FALSE(is_fault(dataset->annotation("a.npz#0")));
    EXPECT_THAT(fault_of(dataset->annotation("a.npz#1")),
                HasSubstr("h36m/a.npz (" + std::string(name) + ", row 1)"));
  }
}

TEST_F(ExtractedLayoutTest, ReadsOneFolderOfManyVideosOnce) {
  add_images({"all/S1_A.7_000001.jpg", "all/S1_A.7_000006.jpg", "all/S5_B.8_000001.jpg",
              "all/S5_B.8_000003.png", "all/S5_B.8_000003.jpg"});
  add_npz(members({"all/S1_A.7_000001.jpg", "./all/S5_B.8_000001.jpg"}));
  EXPECT_THAT(paired(*open(), 0, {1}), ElementsAre("present h36m/all/S1_A.7_000006.jpg 6"));
  EXPECT_THAT(paired(*open(), 1, {1}), ElementsAre("present h36m/all/S5_B.8_000003.jpg 3"));
}

TEST_F(ExtractedLayoutTest, TellsOfImagesWithoutLabels) {
  add_images({kFolder + kFirst, "S1/S1_Eating.7/S1_Eating.7_000001.jpg"});
  add_npz(members({kFirst}));
  EXPECT_THAT(open()->notes(), Contains("1 folder of images without labels, the first "
                                        "h36m/S1/S1_Eating.7"));
}

TEST_F(ExtractedLayoutTest, ImagesLeftOutAreCountedAndNamed) {
  add_images({"all/S1_A.7_000001.jpg", "all/S1_A.7_000001.png", "all/S1_A.7_000006.webp",
              "all/S1_A.7_000006_mask.png", "all/S1_A.7_000011.JPG", "all/readme.txt"});
  add_npz(members({"all/S1_A.7_000001.jpg"}));
  EXPECT_THAT(open()->notes(), Contains("4 images left out in h36m/all: S1_A.7_000001.png, "
                                        "S1_A.7_000006.webp, S1_A.7_000006_mask.png, "
                                        "S1_A.7_000011.JPG"));
}

TEST_F(ExtractedLayoutTest, ReadsSharedData) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec = extracted_spec("human36m_lists");
  spec.annotations = "human36m_lists/test_h36m_body3d.npz";
  const auto dataset = open_human36m_dataset(spec, data);
  EXPECT_THAT(dataset->notes(), IsEmpty());
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("human36m_lists/cameras.pkl", "human36m_lists/test_h36m_body3d.npz"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[1].sample_id, "S5_SittingDown.54138969_002061");
  EXPECT_DOUBLE_EQ(frames[1].frame.time_s, 2060 / 50.0);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(fs::exists(data / frames[i].frame.path));
    EXPECT_THAT(paired(*dataset, i, {0, 1}), ElementsAre(StartsWith("present"), "beyond"));
  }
  const auto camera = nlohmann::json::parse(annotation_of(*dataset).original)["cameras.pkl"];
  EXPECT_EQ(camera["name"], "camera1");
  EXPECT_EQ(camera["w"], 1000);
  EXPECT_EQ(camera["R"].size(), 3u);
  // Without a choice the list of 17 joints is the only one that fits; the other has 24.
  spec.annotations.reset();
  EXPECT_EQ(open_human36m_dataset(spec, data)->labelled_frames()[0].label_key,
            "test_h36m_body3d.npz#0");
  spec.annotations = "human36m_lists/test_h36m.npz";
  EXPECT_EQ(open_human36m_dataset(spec, data)->label_schema().joint_names.size(), 24u);
}

/// The people of the shared data, by what a name of a joint means.
class RealPeopleTest : public ::testing::Test {
 protected:
  void SetUp() override {
    EVENTGAN_SHARED_DATA_OR_SKIP(data);
    SourceSpec spec = extracted_spec("human36m_lists");
    spec.annotations = "human36m_lists/test_h36m_body3d.npz";
    const auto dataset = open_human36m_dataset(spec, data);
    names_ = dataset->label_schema().joint_names;
    for (const LabelledFrame& frame : dataset->labelled_frames()) {
      annotations_.push_back(*dataset->annotation(frame.label_key));
    }
    ASSERT_EQ(annotations_.size(), 4u);
  }

  std::array<double, 3> joint3d(const Person& person, const std::string& name) const {
    return person.joints3d_mm.at(std::ranges::find(names_, name) - names_.begin()).value();
  }

  std::vector<std::string> names_;
  std::vector<Annotation> annotations_;
};

TEST_F(RealPeopleTest, HipsAndShouldersHaveTheSameSides) {
  for (const Annotation& annotation : annotations_) {
    const Person& person = annotation.persons.at(0);
    double product = 0, hips = 0, shoulders = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double hip = joint3d(person, "right_hip")[i] - joint3d(person, "left_hip")[i];
      const double shoulder =
          joint3d(person, "right_shoulder")[i] - joint3d(person, "left_shoulder")[i];
      product += hip * shoulder;
      hips += hip * hip;
      shoulders += shoulder * shoulder;
    }
    EXPECT_GT(product / std::sqrt(hips * shoulders), 0.9);
  }
}

/// As shard_format.md says.
Point projected(const Intrinsics& camera, const LensDistortion& lens,
                const std::array<double, 3>& at) {
  const double a = at[0] / at[2], b = at[1] / at[2], r2 = a * a + b * b;
  const double d = 1 + lens.k1 * r2 + lens.k2 * std::pow(r2, 2) + lens.k3 * std::pow(r2, 3) +
                   lens.p1 * b + lens.p2 * a;
  return {camera.focal_x * (a * d + lens.p2 * r2) + camera.centre_x,
          camera.focal_y * (b * d + lens.p1 * r2) + camera.centre_y};
}

TEST_F(RealPeopleTest, CameraAndDistortionProjectTheJointsInTheImageAndInTheVolume) {
  for (const Annotation& annotation : annotations_) {
    const Person& person = annotation.persons.at(0);
    ASSERT_TRUE(person.camera && person.distortion);
    // Stretched to other shapes, with borders, and cut.
    for (const Placement& placement :
         {Placement{{1000, 1000}, {260, 861}, {260, 861}, 0, 0},
          Placement{{1000, 1000}, {260, 260}, {260, 346}, 43, 0},
          Placement{{1000, 1000}, {400, 600}, {260, 346}, -127, -70}}) {
      const auto outcome = map_labels(annotation, placement, "a.npz");
      ASSERT_FALSE(is_fault(outcome));
      const VolumePerson& mapped = outcome->persons.at(0);
      for (std::size_t j = 0; j < person.joints.size(); ++j) {
        const Point source = projected(*person.camera, *person.distortion, *person.joints3d_mm[j]);
        EXPECT_NEAR(source.x, person.joints[j].at.x, 1e-3);
        EXPECT_NEAR(source.y, person.joints[j].at.y, 1e-3);
        const Point volume =
            projected(mapped.camera.value(), *person.distortion, *person.joints3d_mm[j]);
        EXPECT_NEAR(volume.x, mapped.joints[j].x, 1e-3);
        EXPECT_NEAR(volume.y, mapped.joints[j].y, 1e-3);
      }
    }
  }
}

}  // namespace
}  // namespace eventgan

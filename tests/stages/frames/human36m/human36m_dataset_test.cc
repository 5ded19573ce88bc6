#include "stages/frames/human36m/detail/human36m_dataset.h"

#include <limits>
#include <set>

#include "stages/frames/human36m/derived_frame.h"
#include "stages/frames/human36m/detail/camera_book.h"
#include "stages/frames/human36m/detail/pose_table.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/human36m/human36m_fixture.h"

namespace eventgan {
namespace {

TEST(Human36mJointsTest, NamesAreDistinctAndAsManyAsAsked) {
  for (const std::size_t count : {0u, 1u, 17u, 24u, 32u}) {
    const auto names = human36m_joint_names(count);
    EXPECT_EQ(names.size(), count);
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), count);
  }
  EXPECT_THAT(human36m_joint_names(2), ElementsAre("joint_0", "joint_1"));
}

TEST(Human36mJointsTest, ThirtyTwoJointsHoldTheUsualSeventeenWhereTrainersTakeThem) {
  const auto names = human36m_joint_names(32);
  // The choice every trainer makes: 0 1 2 3 6 7 8 12 13 14 15 17 18 19 25 26 27.
  EXPECT_EQ(names[3], "RightFoot");
  EXPECT_EQ(names[8], "LeftFoot");
  EXPECT_EQ(names[12], "Spine1");
  EXPECT_EQ(names[15], "Head_Site");
  EXPECT_EQ(names[19], "LeftHand");
  EXPECT_EQ(names[27], "RightHand");
}

TEST(Human36mJointsTest, SeventeenJointsHaveTheSidesOfThoseAmongTheThirtyTwo) {
  const auto all = human36m_joint_names(32);
  const auto chosen = human36m_joint_names(17);
  const std::vector<std::size_t> choice = {0,  1,  2,  3,  6,  7,  8,  12, 13,
                                           14, 15, 17, 18, 19, 25, 26, 27};
  for (std::size_t i = 0; i < choice.size(); ++i) {
    EXPECT_EQ(chosen[i].starts_with("right"), all[choice[i]].starts_with("Right")) << i;
    EXPECT_EQ(chosen[i].starts_with("left"), all[choice[i]].starts_with("Left")) << i;
  }
  EXPECT_EQ(chosen[1], "right_hip");
  EXPECT_EQ(chosen[6], "left_foot");
}

TEST(Human36mJointsTest, AliasesOfThirtyTwoAreTheNamesOfSeventeenInTheirOrder) {
  auto aliases = human36m_joint_aliases(32);
  ASSERT_EQ(aliases.size(), 32u);
  EXPECT_EQ(aliases[27], "right_wrist");
  EXPECT_EQ(aliases[4], "");
  std::erase(aliases, "");
  EXPECT_EQ(aliases, human36m_joint_names(17));
  EXPECT_TRUE(human36m_joint_aliases(17).empty());
}

TEST(DeriveFrame, TakesAnnotatedJointsAlone) {
  Person person;
  derive_frame(person);
  EXPECT_FALSE(person.box);
  EXPECT_EQ(person.scale, -1);
  person.joints = {{{10, 40}, -1}, {kMissingPoint, 0}, {{30, 20}, 0}};
  derive_frame(person);
  EXPECT_EQ(person.box, (Rectangle{10, 20, 31, 41}));
  EXPECT_EQ(person.center, (Point{20, 30}));
  EXPECT_DOUBLE_EQ(person.scale, 0.12);
}

NumberedSequence stored(const std::vector<std::int64_t>& numbers) {
  std::vector<NumberedSequence::Frame> frames;
  for (const std::int64_t number : numbers) {
    frames.emplace_back(number, "img_00" + std::to_string(number) + ".png");
  }
  return NumberedSequence(std::move(frames));
}

/// What folder "root/7" has so many steps after each of the frames.
void expect_frames(const FrameFolder& folder,
                   const std::map<std::pair<int, int>, std::string>& at) {
  for (const auto& [number_and_step, text] : at) {
    const auto& [number, step] = number_and_step;
    EXPECT_EQ(text_of(folder.paired_frame(number, step)), text) << number << " + " << step;
  }
}

TEST(FrameFolderTest, CountsStoredFramesWhateverTheirNumbers) {
  // Labels lie farther apart than images.
  expect_frames(FrameFolder("root/7", "img_", stored({1000, 1005, 1006, 1040}), {1000, 1040}),
                {{{1000, 1}, "present root/7/img_001005.png 1005"},
                 {{1000, 2}, "present root/7/img_001006.png 1006"},
                 {{1000, 3}, "present root/7/img_001040.png 1040"},
                 {{1000, 4}, "beyond"},
                 {{1040, -3}, "present root/7/img_001000.png 1000"},
                 {{1040, -4}, "beyond"}});
}

TEST(FrameFolderTest, ALabelledFrameWithoutImageCountsAsMissing) {
  expect_frames(FrameFolder("root/7", "img_", stored({1000, 1005}), {1010, 1000, 1003, 1003}),
                {{{1000, 1}, "missing root/7/img_001003.png 1003"},
                 {{1000, 2}, "present root/7/img_001005.png 1005"},
                 {{1003, 0}, "missing root/7/img_001003.png 1003"},
                 {{1005, 1}, "missing root/7/img_001010.png 1010"},
                 {{1005, 2}, "beyond"}});
}

TEST(FrameFolderTest, AFrameThatIsNotThereHasThoseBesideIt) {
  expect_frames(FrameFolder("root/7", "img_", stored({1000, 1005}), {}),
                {{{1002, 0}, "missing root/7/img_001002.png 1002"},
                 {{1002, 1}, "present root/7/img_001005.png 1005"},
                 {{1002, -1}, "present root/7/img_001000.png 1000"},
                 {{1002, 2}, "beyond"}});
}

TEST(FrameFolderTest, NamesAbsentFramesLikeTheStoredOnes) {
  EXPECT_EQ(FrameFolder("r", "img_", stored({1000}), {}).frame(1001).path, "r/img_001001.png");
  EXPECT_EQ(FrameFolder("r", "img_", {}, {}).frame(12).path, "r/img_000012.jpg");
  EXPECT_EQ(FrameFolder("r", "img_", {}, {}).frame(1234567).path, "r/img_1234567.jpg");
}

TEST(FrameFolderTest, EmptyFolderHasNoPairedFrames) {
  expect_frames(FrameFolder("r", "img_", {}, {}),
                {{{1, 1}, "beyond"}, {{1, 0}, "missing r/img_000001.jpg 1"}});
}

TableColumns columns() {
  return TableColumns({{"points", {{2, 3, 1}, std::vector<double>{1, 2, 3, 4, 5, 6}}},
                       {"name", {{2}, std::vector<std::string>{"a", "b"}}},
                       {"frame", {{2}, std::vector<double>{7, 7.5}}},
                       {"single", {{}, std::vector<double>{9}}},
                       {"x/other", {{2}, std::vector<std::int32_t>{1, 2}}}},
                      "file.h5");
}

TEST(TableColumnsTest, ComparesShapes) {
  const TableColumns table = columns();
  const auto any = std::nullopt;
  EXPECT_EQ(table.need("points", {2, any, 1}).size(), 6u);
  EXPECT_EQ(table.need("name", {any}, /*text=*/true).size(), 2u);
  const std::string got = ", got numbers [2, 3, 1], in file.h5 (points)";
  EXPECT_THROWS(table.need("points", {any, 4, 1}), InputError,
                StrEq("expected numbers [at least 1, 4, 1]" + got));
  EXPECT_THROWS(table.need("points", {2, 3}), InputError, "expected numbers [2, 3]" + got);
  EXPECT_THROWS(table.need("points", {2, 3, 1, 1}), InputError,
                "expected numbers [2, 3, 1, 1]" + got);
  EXPECT_THROWS(table.need("name", {2}), InputError, "expected numbers [2], got text [2]");
  EXPECT_THROWS(table.need("frame", {2}, /*text=*/true), InputError,
                "expected text [2], got numbers [2]");
  EXPECT_THROWS(table.need("absent", {2}), InputError,
                StrEq("expected numbers [2], got no such array, in file.h5 (absent)"));
}

TEST(TableColumnsTest, GivesRows) {
  const TableColumns table = columns();
  EXPECT_THAT(table.row_of("points", 1), ElementsAre(4, 5, 6));
  EXPECT_EQ(table.whole_number("frame", 0), 7);
  EXPECT_THROWS(table.whole_number("frame", 1), InputError,
                "expected a whole number in [0, 10^9), got 7.5", "(frame, row 1)");
  EXPECT_EQ(table.fields(1, 2, "x/").dump(),
            R"({"frame":7.5,"name":"b","points":[[4.0],[5.0],[6.0]]})");
  EXPECT_EQ(table.fields(0, 2)["x/other"], 1);
  EXPECT_EQ(table.fields(0, 3).dump(), "{}");
}

TEST(TableColumnsTest, FindsValuesThatAreNotFinite) {
  const TableColumns table = columns();
  EXPECT_FALSE(table.not_finite({0, -1e300}, "points", 0));
  EXPECT_EQ(table.not_finite({0, -std::numeric_limits<double>::infinity()}, "points", 4)->reason,
            "expected finite numbers, got -inf, in file.h5 (points, row 4)");
}

CameraBook read(const std::string& pickle) {
  const TemporaryFolder folder;
  write_file(folder / "cameras.pkl", pickle);
  return read_camera_book(folder / "cameras.pkl");
}

const std::string kFocal = pickled_field("f", "\x0b\x0c"), kCentre = pickled_field("c", "\x05\x06");

TEST(CameraBookTest, ReadsIntrinsicsAndAllFields) {
  const CameraBook cameras =
      read(camera_pickle(kFocal + kCentre +
                         "U\x04nameX\x04\x00\x00\x00"
                         "cam1U\x01wM\xe8\x03U\x01oNU\x01xG\x3f\xf0\x00\x00\x00\x00\x00\x00"s));
  ASSERT_EQ(cameras.size(), 1u);
  const Human36mCamera& camera = cameras.at({"S1", "7"});
  EXPECT_EQ(camera.intrinsics, (Intrinsics{11, 12, 5, 6}));
  EXPECT_EQ(camera.fields.dump(),
            R"({"f":[11,12],"c":[5,6],"name":"cam1","w":1000,"o":null,"x":1.0})");
}

TEST(CameraBookTest, ReadsTheLensDistortion) {
  const std::string both = kFocal + kCentre;
  const std::string k = pickled_field("k", "\x01\x02\x03"), p = pickled_field("p", "\x04\x05");
  EXPECT_EQ(read(camera_pickle(both + k + p)).at({"S1", "7"}).distortion,
            (LensDistortion{.k1 = 1, .k2 = 2, .k3 = 3, .p1 = 4, .p2 = 5}));
  EXPECT_FALSE(read(camera_pickle(both)).at({"S1", "7"}).distortion);
  EXPECT_THROWS(read(camera_pickle(both + k)), InputError, "(p)");
  EXPECT_THROWS(read(camera_pickle(both + p + pickled_field("k", "\x01\x02"))), InputError,
                "expected 3 numbers, got [2]");
}

TEST(CameraBookTest, RefusesCamerasThatSeeNothing) {
  for (const std::string& focal : {"\0\0"s, "\0\x0c"s, "\x0b\0"s}) {
    EXPECT_THROWS(read(camera_pickle(pickled_field("f", focal) + kCentre)), InputError,
                  "expected focal lengths above 0", "(S1 7)");
  }
}

/// One joint at (X, Y, Z) = (500, -250, 1000) mm, so at (a, b) = (0.5, -0.25).
Person person_seen_at(Point at) {
  Person person;
  person.joints = {{at, -1}, {kMissingPoint, 0}, {{9, 9}, -1}};
  person.joints3d_mm = {std::array{500.0, -250.0, 1000.0}, std::array{1.0, 1.0, 1.0}, std::nullopt};
  person.camera = Intrinsics{1000, 2000, 500, 600};
  return person;
}

TEST(ProjectionErrorTest, IsTheDistanceFromWhereTheCameraProjects) {
  // Without distortion: 1000 * 0.5 + 500, 2000 * -0.25 + 600.
  EXPECT_EQ(projection_error_px(person_seen_at({1000, 100})), 0);
  EXPECT_EQ(projection_error_px(person_seen_at({1003, 96})), 5);

  // r2 = 0.3125; d = 1 + 0.5 * 0.3125 + 0.25 * 0.3125^2 + 2 * 0.3125^3 + 0.2 * -0.25 + 0.4 * 0.5
  // = 1.39170...; a' = 0.5 d + 0.4 r2, b' = -0.25 d + 0.2 r2.
  const double d = 1 + 0.15625 + 0.0244140625 + 0.06103515625 - 0.05 + 0.2;
  Person person =
      person_seen_at({1000 * (0.5 * d + 0.125) + 500, 2000 * (-0.25 * d + 0.0625) + 600});
  person.distortion = {.k1 = 0.5, .k2 = 0.25, .k3 = 2, .p1 = 0.2, .p2 = 0.4};
  EXPECT_NEAR(projection_error_px(person), 0, 1e-9);
}

TEST(ProjectionErrorTest, OnlyACameraThatFitsIsKept) {
  for (const double off : {0.0, 19.0, 21.0}) {
    Person person = person_seen_at({1000 + off, 100});
    person.distortion = LensDistortion{};
    take_wrong_camera(person);
    EXPECT_EQ(person.camera.has_value(), off < kProjectionTolerance_px);
    EXPECT_EQ(person.distortion.has_value(), off < kProjectionTolerance_px);
    EXPECT_EQ(person.joints3d_mm.size(), 3u);
  }
}

TEST(CameraBookTest, RefusesOtherPickles) {
  for (const std::string& pickle :
       {"N."s, "no pickle"s, ""s, "}NNs."s, "}U\1aU\1b\x86Ns."s, camera_pickle(kFocal),
        camera_pickle(kCentre), camera_pickle(kFocal + "U\1cN"),
        camera_pickle(kFocal + pickled_field("c", "\x05")),
        camera_pickle(kFocal + kCentre + "U\x01x]"), "}]]\x86}(" + kFocal + kCentre + "us.",
        "cos\nsystem\n(S'true'\ntR."s}) {
    EXPECT_THROWS(read(pickle), InputError, "expected ", "cameras.pkl")
        << ::testing::PrintToString(pickle);
  }
}

TEST(CameraBookTest, ReadsSharedData) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const CameraBook cameras = read_camera_book(data / "human36m_lists" / "cameras.pkl");
  EXPECT_EQ(cameras.size(), 44u);  // 11 subjects with 4 cameras
  const Human36mCamera& camera = cameras.at({"S1", "54138969"});
  ASSERT_TRUE(camera.distortion);
  const auto& [focal_x, focal_y, centre_x, centre_y] = camera.intrinsics;
  const auto& [k1, k2, k3, p1, p2] = *camera.distortion;
  // As Python prints them.
  const double expected[] = {1145.04940459, 1143.78109572, 512.54150496, 515.45148698, -0.20709891,
                             0.24777518,    -0.00307515,   -0.00142447,  -0.0009757};
  EXPECT_THAT((std::array{focal_x, focal_y, centre_x, centre_y, k1, k2, k3, p1, p2}),
              ::testing::Pointwise(::testing::DoubleNear(1e-8), expected));
}

}  // namespace
}  // namespace eventgan

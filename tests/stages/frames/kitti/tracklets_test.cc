#include "stages/frames/kitti/tracklets.h"

#include <nlohmann/json.hpp>
#include <numbers>

#include "stages/frames/kitti/kitti_label.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/kitti/raw_fixture.h"

namespace eventgan {
namespace {

using ::testing::FloatNear;
using testing::kCamToCam;
using testing::kVeloToCam;
using ::testing::Pointwise;
using testing::pose_xml;
using testing::tracklet_xml;
using testing::tracklets_xml;

/// A car in frames 2 and 3, somebody sitting in frame 3.
Tracklets car_and_person() {
  return {tracklets_xml(tracklet_xml("Car", "2", pose_xml("10") + pose_xml("11.5", "0.25")) +
                        tracklet_xml("Person (sitting)", "3", pose_xml("20"))),
          "t.xml"};
}

TEST(Tracklets, GivesEachFrameThePosesOfItsTracklets) {
  const Tracklets tracklets = car_and_person();
  EXPECT_THAT(tracklets.frames(), ElementsAre(2, 3));
  const auto third = *tracklets.frame(3);
  ASSERT_EQ(third.poses.size(), 2u);
  const TrackletPose& car = third.poses[0];
  EXPECT_THAT((std::array{car.height, car.width, car.length, car.x, car.y, car.z, car.rotation_z}),
              ElementsAre(2, 1, 4, 11.5, 0, -1, 0.25));
  EXPECT_EQ(car.track, 0);
  EXPECT_EQ(car.class_id, kitti_class_id("Car"));
  EXPECT_EQ(car.occlusion, 1);
  EXPECT_EQ(car.truncation, 0);
  EXPECT_EQ(third.poses[1].track, 1);
  EXPECT_EQ(third.poses[1].class_id, kitti_class_id("Person_sitting"));
}

TEST(Tracklets, TheJsonHoldsEveryField) {
  const auto frame = *car_and_person().frame(3);
  const auto json = nlohmann::json::parse(frame.json);
  ASSERT_EQ(json.size(), 2u);
  EXPECT_EQ(json[0], nlohmann::json::parse(R"({
      "track": 0, "objectType": "Car", "h": 2.0, "w": 1, "l": 4, "first_frame": 2, "finished": 1,
      "pose": {"frame": 3, "tx": 11.5, "ty": 0, "tz": -1, "rx": 0, "ry": 0, "rz": 0.25, "state": 2,
               "occlusion": 1, "occlusion_kf": 0, "truncation": 0, "amt_occlusion": -1}})"));
  EXPECT_EQ(json[1]["objectType"], "Person (sitting)");
}

TEST(Tracklets, AFrameWithoutTrackletsIsAnEmptyArray) {
  for (const std::int64_t number : {-1, 1, 4}) {
    const auto frame = *car_and_person().frame(number);
    EXPECT_THAT(frame.poses, IsEmpty());
    EXPECT_EQ(frame.json, "[]");
  }
  EXPECT_THAT(Tracklets(tracklets_xml(""), "t.xml").frames(), IsEmpty());
}

/// A car of these poses from frame 0 on, with a text in the place of another.
Tracklets car_with(const std::string& poses, const std::string& right = "",
                   const std::string& wrong = "") {
  std::string xml = tracklets_xml(tracklet_xml("Car", "0", poses));
  xml.replace(xml.find(right), right.size(), wrong);
  return {xml, "t.xml"};
}

TEST(Tracklets, AFieldThatIsNoNumberIsAFaultOfItsFrame) {
  const Tracklets tracklets = car_with(pose_xml("10") + pose_xml("nan"));
  EXPECT_FALSE(is_fault(tracklets.frame(0)));
  EXPECT_EQ(fault_of(tracklets.frame(1)),
            "expected a finite number for tx, got 'nan', in t.xml (tracklet 0)");
}

TEST(Tracklets, AnUnknownTypeIsAFault) {
  EXPECT_THAT(fault_of(car_with(pose_xml("10"), ">Car<", ">Lorry<").frame(0)),
              AllOf(HasSubstr("got 'Lorry'"), HasSubstr("in t.xml (tracklet 0)")));
}

TEST(Tracklets, ASizeThatIsNotAboveZeroIsAFault) {
  for (const auto& [right, wrong] :
       {std::pair("<h>2.0<", "<h>-2.0<"), {"<w>1<", "<w>0<"}, {"<l>4<", "<l>-1<"}}) {
    EXPECT_THAT(
        fault_of(car_with(pose_xml("10"), right, wrong).frame(0)),
        AllOf(HasSubstr("expected a size above 0 for "), HasSubstr("in t.xml (tracklet 0)")))
        << wrong;
  }
}

TEST(Tracklets, OcclusionHasItsRange) {
  const auto with_occlusion = [](const std::string& level) {
    return car_with(pose_xml("10"), "<occlusion>1<", "<occlusion>" + level + "<").frame(0);
  };
  for (const auto& [written, read] : {std::pair("0", 0), {"2", 2}, {"-1", -1}, {"255", -1}}) {
    EXPECT_EQ(with_occlusion(written)->poses.at(0).occlusion, read);
  }
  for (const std::string level : {"4", "-2", "99"}) {
    EXPECT_EQ(
        fault_of(with_occlusion(level)),
        "expected a number from -1 to 3 for occlusion, got " + level + ", in t.xml (tracklet 0)");
  }
}

TEST(Tracklets, ACountThatIsNotThatOfTheItemsIsAnError) {
  const std::string xml =
      tracklets_xml(tracklet_xml("Car", "0", pose_xml("10") + pose_xml("11")) +
                    tracklet_xml("Car", "0", pose_xml("10") + pose_xml("11") + pose_xml("12")));
  EXPECT_NO_THROW(Tracklets(xml, "t.xml"));
  const std::array<std::string, 3> cases[] = {
      {"<tracklets><count>2", "<tracklets><count>3",
       "expected 3 tracklets as <count> says, got 2, in t.xml"},
      {"<poses><count>3", "<poses><count>2",
       "expected 2 poses as <count> says, got 3, in t.xml (tracklet 1)"},
      {"<poses><count>3</count>", "<poses>",
       "expected a whole number for count, got '', in t.xml (tracklet 1)"}};
  for (const auto& [right, wrong, why] : cases) {
    std::string changed = xml;
    changed.replace(changed.find(right), right.size(), wrong);
    EXPECT_THROWS(Tracklets(changed, "t.xml"), InputError, StrEq(why));
  }
}

TEST(Tracklets, BytesThatAreNotUtf8DoNotStopTheJson) {
  const auto frame =
      *car_with(pose_xml("10"), "</poses>", "</poses><remark>\xff</remark>").frame(0);
  EXPECT_EQ(nlohmann::json::parse(frame.json)[0]["remark"], "\xEF\xBF\xBD");
}

TEST(Tracklets, AFileOfAnotherKindIsAnErrorThatNamesIt) {
  const auto from = [](const std::string& frame) {
    return tracklets_xml(tracklet_xml("Car", frame, pose_xml("10")));
  };
  const std::string whole = from("0");
  for (const std::string& xml : {""s, "text"s, "<a/>"s, whole.substr(0, whole.size() / 2), from(""),
                                 from("-1"), from("9999999999")}) {
    EXPECT_THROWS(Tracklets(xml, "t.xml"), InputError, "expected", "in t.xml") << xml;
  }
}

std::optional<RawCalibration> read(const std::string& velo_to_cam, const std::string& cam_to_cam) {
  const TemporaryFolder folder;
  write_file(folder / "2011_09_26/calib_velo_to_cam.txt", velo_to_cam);
  write_file(folder / "2011_09_26/calib_cam_to_cam.txt", cam_to_cam);
  return read_raw_calibration(SourceRoot(".", folder.path()), "2011_09_26");
}

TEST(RawCalibration, TakesAPointThroughBothFrames) {
  const auto calibration = read("R: 0 -1 0 0 0 -1 1 0 0\nT: 0.5 0.25 -1\n",
                                "S_rect_02: 1242 375\n"
                                "R_rect_00: 0 1 0 -1 0 0 0 0 1\n"
                                "P_rect_02: 100 0 50 200 0 100 20 0 0 0 1 0\n");
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->image, (ImageSize{375, 1242}));
  // R (5, 1, 2) + T = (-1, -2, 5) + (0.5, 0.25, -1) = (-0.5, -1.75, 4); then x = y, y = -x.
  EXPECT_THAT(calibration->to_rectified({5, 1, 2}), ElementsAre(-1.75, 0.5, 4));
  // u = (100 (-1.75) + 50 4 + 200) / 4, v = (100 0.5 + 20 4) / 4.
  EXPECT_EQ(calibration->project({-1.75, 0.5, 4}), (Point{56.25, 32.5}));
}

TEST(RawCalibration, NeedsBothFiles) {
  const TemporaryFolder folder;
  const SourceRoot root(".", folder.path());
  EXPECT_FALSE(read_raw_calibration(root, "2011_09_26"));
  write_file(folder / "2011_09_26/calib_velo_to_cam.txt", kVeloToCam);
  EXPECT_FALSE(read_raw_calibration(root, "2011_09_26"));
  write_file(folder / "2011_09_26/calib_cam_to_cam.txt", kCamToCam);
  EXPECT_TRUE(read_raw_calibration(root, "2011_09_26"));
}

// Every object would lie in one place where a matrix has no full rank, or nowhere, and no box be
// found of it.
TEST(RawCalibration, AMalformedFileIsAnErrorThatNamesTheKey) {
  const std::string turned = "R: 0 -1 0 0 0 -1 1 0 0\n", size = "S_rect_02: 100 40\n";
  const std::string rotation = "R_rect_00: 1 0 0 0 1 0 0 0 1\n";
  const std::string projection = "P_rect_02: 100 0 50 0 0 100 20 0 0 0 1 0\n";
  const std::array<std::string, 3> cases[] = {
      {turned, kCamToCam, "expected a line T, got none"},
      {"R: 1 2 3\nT: 0 0 0\n", kCamToCam, "expected 9 numbers for R, got 3"},
      {turned + "T: 0 x 0\n", kCamToCam, "got 'x'"},
      {turned + "T: 0 nan 0\n", kCamToCam, "got 'nan'"},
      {kVeloToCam, "", "expected a line R_rect_00"},
      {kVeloToCam, "S_rect_02: 0 40\n" + rotation + projection, "expected an image size"},
      {"R: 0 0 0 0 0 0 0 0 0\nT: 0 0 0\n", kCamToCam, "a matrix of full rank for R, got"},
      {kVeloToCam, size + "R_rect_00: 1 0 0 0 1 0 1 1 0\n" + projection,
       "a matrix of full rank for R_rect_00"},
      {kVeloToCam, size + rotation + "P_rect_02: 0 0 0 0 0 0 0 0 0 0 0 1\n",
       "a matrix of full rank for P_rect_02"}};
  for (const auto& [velo_to_cam, cam_to_cam, message] : cases) {
    EXPECT_THROWS(read(velo_to_cam, cam_to_cam), InputError, message, "2011_09_26/calib_");
  }
}

constexpr double kPi = std::numbers::pi;

/// As tests/stages/frames/kitti/raw_fixture.h: the scanner's (x, y, z) is seen at
/// (50 - 100 y/x, 20 - 100 z/x) in an image of 100 x 40 pixels.
const RawCalibration kCalibration{{0, -1, 0, 0, 0, -1, 1, 0, 0},
                                  {0, 0, 0},
                                  {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                  {100, 0, 50, 0, 0, 100, 20, 0, 0, 0, 1, 0},
                                  {40, 100}};

/// A car 2 m high, 1 m wide and 4 m long that drives straight ahead.
TrackletPose car(double x, double y, double z, double rotation_z = 0) {
  return {7,
          kitti_class_id("Car"),
          2,
          1,
          4,
          x,
          y,
          z,
          rotation_z,
          /*occlusion=*/1,
          /*truncation=*/0};
}

Box box_of(const TrackletPose& pose) {
  const auto box = to_box(pose, kCalibration);
  EXPECT_TRUE(box);
  return box.value_or(Box());
}

TEST(TrackletBox, SurroundsTheProjectedCuboid) {
  const Box box = box_of(car(12, 0, -1));
  // The rear, 10 m away, is the largest: half a metre to each side, a metre up and down.
  EXPECT_NEAR(box.xyxy.left, 50 - 100 * 0.5 / 10, 1e-9);
  EXPECT_NEAR(box.xyxy.right, 50 + 100 * 0.5 / 10, 1e-9);
  EXPECT_NEAR(box.xyxy.top, 20 - 100 * 1.0 / 10, 1e-9);
  EXPECT_NEAR(box.xyxy.bottom, 20 + 100 * 1.0 / 10, 1e-9);
  EXPECT_EQ(box.class_id, kitti_class_id("Car"));
  EXPECT_EQ(box.occlusion, 1);
  EXPECT_EQ(box.truncation, 0);
  EXPECT_EQ(box.track_id, 7);
  EXPECT_FALSE(box.ignore);
}

TEST(TrackletBox, ATurnedCuboidShowsItsLength) {
  const Rectangle seen = box_of(car(12, 0, -1, kPi / 2)).xyxy;
  // Now 4 m across and 1 m deep: the near side is 11.5 m away.
  EXPECT_NEAR(seen.right - seen.left, 100 * 4 / 11.5, 1e-9);
}

TEST(TrackletBox, PlacesTheUndersideInTheRectifiedFrame) {
  const Box box = box_of(car(12, 2, -1));
  const std::array<float, 7> expected{2, 1, 4, -2, 1, 12, static_cast<float>(-kPi / 2)};
  EXPECT_THAT(box.box3d, Pointwise(FloatNear(1e-6f), expected));
  // The car lies to the left, at atan2(-2, 12).
  EXPECT_NEAR(box.alpha, -kPi / 2 + std::atan2(2, 12), 1e-6);
}

// KITTI object's cuboid: corner (l/2, 0, 0) turned by rotation_y about the camera's y, (x, y, z) ->
// (x cos + z sin, y, -x sin + z cos). It must be the front that the scanner sees.
TEST(TrackletBox, RotationYTurnsTheLengthAsRotationZDoes) {
  for (double rotation_z = -3; rotation_z <= 3; rotation_z += 0.5) {
    const TrackletPose pose = car(20, 1, -1, rotation_z);
    const Box box = box_of(pose);
    const double ry = box.box3d[6];
    EXPECT_LE(std::abs(ry), kPi + 1e-6);
    const Point3 front = kCalibration.to_rectified(
        {pose.x + 2 * std::cos(rotation_z), pose.y + 2 * std::sin(rotation_z), pose.z});
    EXPECT_NEAR(box.box3d[3] + 2 * std::cos(ry), front[0], 1e-5);
    EXPECT_NEAR(box.box3d[5] - 2 * std::sin(ry), front[2], 1e-5);
  }
}

TEST(TrackletBox, IsCutToTheImage) {
  const Box box = box_of(car(12, 5, -1));  // left edge at 50 - 100 5.5/10 = -5
  EXPECT_EQ(box.xyxy.left, 0);
  EXPECT_NEAR(box.xyxy.right, 50 - 100 * 4.5 / 14, 1e-9);  // of the front, 14 m away
}

TEST(TrackletBox, AnObjectBesideTheCameraReachesToTheImagesLastPixelAsInKittisOwnLabels) {
  // From 2 m behind the camera to 2 m before it, half a metre to a metre and a half to the left.
  // Its right edge is the far inner one, 50 - 100 0.5/2; on the left it runs out of the image.
  EXPECT_EQ(box_of(car(0, 1, -1)).xyxy, (Rectangle{0, 0, 25, 39}));
  // To its right: out of the image of 100 x 40 pixels on that side, from 50 + 100 0.5/2 on.
  EXPECT_EQ(box_of(car(0, -1, -1)).xyxy, (Rectangle{75, 0, 99, 39}));
}

TEST(TrackletBox, NothingBehindTheCameraOrOutsideTheImageIsSeen) {
  EXPECT_FALSE(to_box(car(-12, 0, -1), kCalibration));
  EXPECT_FALSE(to_box(car(12, 20, -1), kCalibration));
  EXPECT_FALSE(to_box(car(12, 0, 10), kCalibration));
}

TEST(TrackletBox, ATruncationThatIsNotAFractionIsUnknown) {
  TrackletPose pose = car(12, 0, -1);
  pose.truncation = 1;
  EXPECT_EQ(to_box(pose, kCalibration)->truncation, -1);
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/kitti/tracklets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "stages/frames/kitti/kitti_label.h"
#include "tests/stages/frames/kitti/raw_fixture.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
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
  const auto third = std::get<TrackletFrame>(tracklets.frame(3));
  ASSERT_EQ(third.poses.size(), 2u);
  const TrackletPose& car = third.poses[0];
  EXPECT_EQ(car.track, 0);
  EXPECT_EQ(car.class_id, kitti_class_id("Car"));
  EXPECT_EQ(car.height, 2);
  EXPECT_EQ(car.width, 1);
  EXPECT_EQ(car.length, 4);
  EXPECT_EQ(car.x, 11.5);
  EXPECT_EQ(car.y, 0);
  EXPECT_EQ(car.z, -1);
  EXPECT_EQ(car.rotation_z, 0.25);
  EXPECT_EQ(car.occlusion, 1);
  EXPECT_EQ(car.truncation, 0);
  EXPECT_EQ(third.poses[1].track, 1);
  EXPECT_EQ(third.poses[1].class_id, kitti_class_id("Person_sitting"));
}

TEST(Tracklets, TheJsonHoldsEveryField) {
  const auto frame = std::get<TrackletFrame>(car_and_person().frame(3));
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
    const auto frame = std::get<TrackletFrame>(car_and_person().frame(number));
    EXPECT_THAT(frame.poses, IsEmpty());
    EXPECT_EQ(frame.json, "[]");
  }
  EXPECT_THAT(Tracklets(tracklets_xml(""), "t.xml").frames(), IsEmpty());
}

TEST(Tracklets, AFieldThatIsNoNumberIsAFaultOfItsFrame) {
  const Tracklets tracklets(
      tracklets_xml(tracklet_xml("Car", "0", pose_xml("10") + pose_xml("nan"))), "t.xml");
  EXPECT_FALSE(is_fault(tracklets.frame(0)));
  EXPECT_EQ(std::get<SampleFault>(tracklets.frame(1)).reason,
            "expected a finite number for tx, got 'nan', in t.xml (tracklet 0)");
}

TEST(Tracklets, AnUnknownTypeIsAFault) {
  const Tracklets tracklets(tracklets_xml(tracklet_xml("Lorry", "0", pose_xml("10"))), "t.xml");
  EXPECT_THAT(std::get<SampleFault>(tracklets.frame(0)).reason,
              AllOf(HasSubstr("got 'Lorry'"), HasSubstr("in t.xml (tracklet 0)")));
}

TEST(Tracklets, ASizeThatIsNotAboveZeroIsAFault) {
  for (const auto& [right, wrong] : {std::pair("<h>2.0<", "<h>-2.0<"), std::pair("<w>1<", "<w>0<"),
                                     std::pair("<l>4<", "<l>-1<")}) {
    std::string xml = tracklets_xml(tracklet_xml("Car", "0", pose_xml("10")));
    xml.replace(xml.find(right), std::string(right).size(), wrong);
    EXPECT_THAT(
        std::get<SampleFault>(Tracklets(xml, "t.xml").frame(0)).reason,
        AllOf(HasSubstr("expected a size above 0 for "), HasSubstr("in t.xml (tracklet 0)")))
        << wrong;
  }
}

TEST(Tracklets, OcclusionHasItsRange) {
  const auto with_occlusion = [](const std::string& level) {
    std::string xml = tracklets_xml(tracklet_xml("Car", "0", pose_xml("10")));
    xml.replace(xml.find("<occlusion>1<"), 13, "<occlusion>" + level + "<");
    return Tracklets(xml, "t.xml").frame(0);
  };
  for (const auto& [written, read] : {std::pair("0", 0), {"2", 2}, {"-1", -1}, {"255", -1}}) {
    EXPECT_EQ(std::get<TrackletFrame>(with_occlusion(written)).poses.at(0).occlusion, read);
  }
  for (const char* level : {"4", "-2", "99"}) {
    EXPECT_EQ(std::get<SampleFault>(with_occlusion(level)).reason,
              std::string("expected a number from -1 to 3 for occlusion, got ") + level +
                  ", in t.xml (tracklet 0)");
  }
}

TEST(Tracklets, ACountThatIsNotThatOfTheItemsIsAnError) {
  const std::string xml =
      tracklets_xml(tracklet_xml("Car", "0", pose_xml("10") + pose_xml("11")) +
                    tracklet_xml("Car", "0", pose_xml("10") + pose_xml("11") + pose_xml("12")));
  const auto error = [&](const std::string& right, const std::string& wrong) -> std::string {
    std::string changed = xml;
    changed.replace(changed.find(right), right.size(), wrong);
    try {
      Tracklets(changed, "t.xml");
      return "";
    } catch (const InputError& refused) {
      return refused.what();
    }
  };
  EXPECT_EQ(error("<count>2", "<count>2"), "");
  EXPECT_EQ(error("<tracklets><count>2", "<tracklets><count>3"),
            "expected 3 tracklets as <count> says, got 2, in t.xml");
  EXPECT_EQ(error("<poses><count>3", "<poses><count>2"),
            "expected 2 poses as <count> says, got 3, in t.xml (tracklet 1)");
  EXPECT_EQ(error("<poses><count>3</count>", "<poses>"),
            "expected a whole number for count, got '', in t.xml (tracklet 1)");
}

TEST(Tracklets, BytesThatAreNotUtf8DoNotStopTheJson) {
  std::string xml = tracklets_xml(tracklet_xml("Car", "0", pose_xml("10")));
  xml.insert(xml.find("</poses>") + 8, "<remark>\xff</remark>");
  const auto frame = std::get<TrackletFrame>(Tracklets(xml, "t.xml").frame(0));
  EXPECT_EQ(nlohmann::json::parse(frame.json)[0]["remark"], "\xEF\xBF\xBD");
}

TEST(Tracklets, AFileOfAnotherKindIsAnErrorThatNamesIt) {
  const std::string whole = tracklets_xml(tracklet_xml("Car", "0", pose_xml("10")));
  for (const std::string& xml :
       {std::string(), std::string("text"), std::string("<a/>"), whole.substr(0, whole.size() / 2),
        tracklets_xml(tracklet_xml("Car", "", pose_xml("10"))),
        tracklets_xml(tracklet_xml("Car", "-1", pose_xml("10"))),
        tracklets_xml(tracklet_xml("Car", "9999999999", pose_xml("10")))}) {
    try {
      Tracklets(xml, "t.xml");
      FAIL() << xml;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("in t.xml"));
    }
  }
}

}  // namespace
}  // namespace eventgan

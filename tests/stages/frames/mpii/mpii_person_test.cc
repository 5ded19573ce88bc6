#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/frames/mpii/mpii_person_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::StrEq;
using ::testing::ThrowsMessage;

/// An entry with one person, who has these fields.
Json one(const std::string& rect) { return Json::parse(R"({"annorect": )" + rect + "}"); }
Json with_points(const std::string& points) {
  return one(R"({"annopoints": {"point": )" + points + "}}");
}

TEST(MpiiPersons, EveryCoordinateLosesOne) {
  const auto persons = parse_mpii_persons(one(
      R"({"x1": 706, "y1": 52, "x2": 776, "y2": 164, "scale": 3.05, "objpos": {"x": 742, "y": 350},
          "annopoints": {"point": [{"x": 711, "y": 621, "id": 0, "is_visible": 1},
                                   {"x": 1.5, "y": 0.5, "id": 15, "is_visible": "0"}]}})"));
  ASSERT_EQ(persons.size(), 1u);
  const Person& person = persons[0];
  ASSERT_EQ(person.joints.size(), 16u);
  EXPECT_EQ(person.joints[0], (Joint{{710, 620}, 1}));
  EXPECT_EQ(person.joints[15], (Joint{{0.5, -0.5}, 0}));
  for (int i = 1; i < 15; ++i) EXPECT_EQ(person.joints[i], (Joint{kMissingPoint, 0})) << i;
  EXPECT_EQ(person.center, (Point{741, 349}));
  EXPECT_EQ(person.scale, 3.05);
  EXPECT_EQ(person.head_box, (Rectangle{705, 51, 775, 163}));
}

TEST(MpiiPersons, FormsOfVisibility) {
  const std::pair<const char*, int> forms[] = {{"1", 1},     {"\"1\"", 1}, {"true", 1}, {"0", 0},
                                               {"\"0\"", 0}, {"false", 0}, {"1.0", 1},  {"0.0", 0},
                                               {"[]", -1},   {"\"\"", -1}};
  for (const auto& [form, visible] : forms) {
    const auto persons = parse_mpii_persons(
        with_points(std::string(R"({"x": 5, "y": 5, "id": 3, "is_visible": )") + form + "}"));
    EXPECT_EQ(persons.at(0).joints[3], (Joint{{4, 4}, visible})) << form;
  }
  EXPECT_EQ(parse_mpii_persons(with_points(R"({"x": 5, "y": 5, "id": 3})")).at(0).joints[3].visible,
            -1);
}

TEST(MpiiPersons, AJointAtZeroIsNotAnnotated) {
  // Pixels count from 1. At 0 on one axis alone it lies just outside the picture.
  const auto persons =
      parse_mpii_persons(with_points(R"([{"x": 0, "y": 0, "id": 3, "is_visible": 1},
                      {"x": 0, "y": 5, "id": 4, "is_visible": 1}])"));
  EXPECT_EQ(persons.at(0).joints[3], (Joint{kMissingPoint, 0}));
  EXPECT_EQ(persons.at(0).joints[4], (Joint{{-1, 4}, 1}));
  EXPECT_THAT(
      [] { parse_mpii_persons(with_points(R"({"x": 0, "y": 0, "id": 3, "is_visible": 2})")); },
      ThrowsMessage<std::invalid_argument>(HasSubstr("got 2")));
}

TEST(MpiiPersons, WhatIsAbsentOrEmptyStaysAbsent) {
  for (const char* rect :
       {"{}",
        R"({"x1": [], "y1": [], "x2": [], "y2": [], "annopoints": [], "scale": [], "objpos": []})",
        R"({"annopoints": {"point": []}, "objpos": {"x": [], "y": []}})"}) {
    const auto persons = parse_mpii_persons(one(rect));
    ASSERT_EQ(persons.size(), 1u) << rect;
    EXPECT_EQ(persons[0].joints, std::vector<Joint>(16, Joint{kMissingPoint, 0}));
    EXPECT_EQ(persons[0].center, kMissingPoint);
    EXPECT_EQ(persons[0].scale, -1);
    EXPECT_FALSE(persons[0].head_box);
    EXPECT_FALSE(has_mpii_persons(one(rect)));
  }
  EXPECT_TRUE(parse_mpii_persons(one("[]")).empty());
  EXPECT_TRUE(parse_mpii_persons(Json::object()).empty());
}

TEST(MpiiPersons, AreAsManyAsAnnorects) {
  const Json entry = one(R"([{"scale": 1}, {"scale": 2, "objpos": {"x": 1, "y": 1}}, {}])");
  const auto persons = parse_mpii_persons(entry);
  ASSERT_EQ(persons.size(), 3u);
  EXPECT_EQ(persons[1].scale, 2);
  EXPECT_EQ(persons[1].center, (Point{0, 0}));
  EXPECT_TRUE(has_mpii_persons(entry));
}

TEST(MpiiPersons, HasPersonsWithPointsAlone) {
  EXPECT_TRUE(has_mpii_persons(with_points(R"({"x": 5, "y": 5, "id": 3})")));
}

TEST(MpiiPersons, RefusesMalformedOnesAndSaysWhere) {
  const std::pair<Json, const char*> bad[] = {
      {with_points(R"({"x": 5, "y": 5, "id": 16})"),
       "expected a whole number from 0 to 15, got 16 at annorect[0].annopoints.point[0].id"},
      {with_points(R"({"x": 5, "y": 5, "id": -1})"), "got -1"},
      {with_points(R"({"x": 5, "y": 5, "id": 1.5})"), "got 1.5"},
      {with_points(R"([{"x": 5, "y": 5, "id": 1}, {"x": 6, "y": 5, "id": 1}])"),
       "expected each joint once, got 1 at annorect[0].annopoints.point[1].id"},
      {with_points(R"({"x": null, "y": 5, "id": 1})"), "expected a finite number, got null"},
      {with_points(R"({"x": "5", "y": 5, "id": 1})"), "expected a finite number, got \"5\""},
      {with_points(R"({"x": 5, "y": [], "id": 1})"), "expected x, y and id"},
      {with_points(R"({"x": 5, "y": 5, "id": 1, "is_visible": 2})"), "expected 0 or 1, got 2"},
      {with_points("7"), "expected x, y and id, got 7"},
      {one(R"({"annopoints": 7})"), "expected a struct, got 7 at annorect[0].annopoints"},
      {one(R"({"objpos": {"x": 1, "y": []}})"), "expected x and y"},
      {one(R"({"objpos": 4})"), "expected x and y, got 4"},
      {one(R"({"x1": 1, "y1": 2, "x2": 3})"), "expected all of x1, y1, x2, y2 or none"},
      {one(R"({"scale": null})"), "expected a finite number, got null at annorect[0].scale"},
      {one(R"([{}, 3])"), "expected a struct, got 3 at annorect[1]"},
  };
  for (const auto& [entry, message] : bad) {
    EXPECT_THAT([&] { parse_mpii_persons(entry); },
                ThrowsMessage<std::invalid_argument>(HasSubstr(message)))
        << entry;
  }
  // Also such an entry is a sample: its fault must be seen.
  EXPECT_TRUE(has_mpii_persons(one(R"({"annopoints": 7})")));
  EXPECT_TRUE(has_mpii_persons(one(R"({"objpos": 4})")));
  EXPECT_TRUE(has_mpii_persons(one("[{}, 3]")));
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/mpii/detail/mpii_annotations.h"

#include <stdexcept>

#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/mpii/mpii_fixture.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;

using Json = nlohmann::ordered_json;

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
  const std::pair<const char*, int> forms[] = {{R"(, "is_visible": 1)", 1},
                                               {R"(, "is_visible": "1")", 1},
                                               {R"(, "is_visible": true)", 1},
                                               {R"(, "is_visible": 0)", 0},
                                               {R"(, "is_visible": "0")", 0},
                                               {R"(, "is_visible": false)", 0},
                                               {R"(, "is_visible": 1.0)", 1},
                                               {R"(, "is_visible": 0.0)", 0},
                                               {R"(, "is_visible": [])", -1},
                                               {R"(, "is_visible": "")", -1},
                                               {"", -1}};
  for (const auto& [form, visible] : forms) {
    const auto persons =
        parse_mpii_persons(with_points(R"({"x": 5, "y": 5, "id": 3)" + std::string(form) + "}"));
    EXPECT_EQ(persons.at(0).joints[3], (Joint{{4, 4}, visible})) << form;
  }
}

TEST(MpiiPersons, AJointAtZeroIsNotAnnotated) {
  // Pixels count from 1. At 0 on one axis alone it lies just outside the image.
  const auto persons =
      parse_mpii_persons(with_points(R"([{"x": 0, "y": 0, "id": 3, "is_visible": 1},
                      {"x": 0, "y": 5, "id": 4, "is_visible": 1}])"));
  EXPECT_EQ(persons.at(0).joints[3], (Joint{kMissingPoint, 0}));
  EXPECT_EQ(persons.at(0).joints[4], (Joint{{-1, 4}, 1}));
  EXPECT_THROWS(parse_mpii_persons(with_points(R"({"x": 0, "y": 0, "id": 3, "is_visible": 2})")),
                std::invalid_argument, "got 2");
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
  EXPECT_TRUE(has_mpii_persons(with_points(R"({"x": 5, "y": 5, "id": 3})"))) << "points alone";
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
    EXPECT_THROWS(parse_mpii_persons(entry), std::invalid_argument, message) << entry;
  }
  // Also such an entry is a sample: its fault must be seen.
  EXPECT_TRUE(has_mpii_persons(one(R"({"annopoints": 7})")));
  EXPECT_TRUE(has_mpii_persons(one(R"({"objpos": 4})")));
  EXPECT_TRUE(has_mpii_persons(one("[{}, 3]")));
}

class MpiiAnnotationsTest : public FolderTest {
 protected:
  std::vector<MpiiEntry> read() const { return read_mpii_annotations(annotations_, keyframes_); }

  fs::path annotations_ = at("mpii_human_pose_v1_u12_1.mat");
  fs::path keyframes_ = at("mpii_human_pose_v1_sequences_keyframes.mat");
};

TEST_F(MpiiAnnotationsTest, ReadsEveryEntryWhole) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::two_persons(), true, "a/00000007.jpg"},
                                   {"b.jpg", mat::empty(), false, "b/00000001.jpg"},
                                   {"c.jpg", mat::centre_only(), false, "c/00000020.jpg"}});
  const auto entries = read();
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[0].image, "a.jpg");
  EXPECT_EQ(entries[0].keyframe, "a/00000007.jpg");
  EXPECT_TRUE(entries[0].is_train && entries[0].has_persons);
  EXPECT_FALSE(entries[1].is_train || entries[1].has_persons);
  EXPECT_TRUE(!entries[2].is_train && entries[2].has_persons);

  // MPII's own numbers from 1, every field also of unknown name, is_visible as it was.
  EXPECT_EQ(entries[0].json,
            R"({"image":{"name":"a.jpg"},"annorect":[{"x1":706,"y1":52,"x2":776,"y2":164,)"
            R"("annopoints":{"point":[{"x":711,"y":621,"id":0,"is_visible":1},)"
            R"({"x":715.5,"y":491,"id":1,"is_visible":"1"},)"
            R"({"x":705,"y":371,"id":2,"is_visible":[]},)"
            R"({"x":781,"y":365,"id":9,"is_visible":0}]},)"
            R"("scale":3.05,"objpos":{"x":742,"y":350},"silhouette":"kept"},)"
            R"({"x1":[],"y1":[],"x2":[],"y2":[],"annopoints":[],"scale":1.2,)"
            R"("objpos":{"x":100,"y":120},"silhouette":[]}],"frame_sec":2,"vididx":[],)"
            R"("img_train":1,"single_person":[1,2],)"
            R"("act":{"cat_name":"sports","act_name":[],"act_id":-1},)"
            R"("annolist_keyframes":{"image":{"name":"a/00000007.jpg"}}})");
  EXPECT_EQ(read_mpii_keyframes(keyframes_),
            (std::vector<std::string>{"a/00000007.jpg", "b/00000001.jpg", "c/00000020.jpg"}));
}

TEST_F(MpiiAnnotationsTest, RefusesArraysOfOtherLength) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::empty(), true, "a/1.jpg"},
                                   {"b.jpg", mat::empty(), true, "b/1.jpg"}});
  mat::write_mat(keyframes_, "annolist_keyframes",
                 mat::structs({{{"image", mat::image("a/1.jpg")}}}));
  EXPECT_THROWS(read(), InputError, "expected 2 elements in annolist_keyframes", "got 1, in ",
                "keyframes.mat");
  mat::write_mat(annotations_, "RELEASE",
                 mat::structure({{"annolist", mat::structs({{{"image", mat::image("a.jpg")}}})},
                                 {"img_train", mat::empty()}}));
  EXPECT_THROWS(read(), InputError, "expected 1 elements in img_train");
}

TEST_F(MpiiAnnotationsTest, RefusesWhatIsNoAnnotation) {
  mat::write_mpii(folder_.path(), {{"", mat::empty(), true, ""}});
  EXPECT_THROWS(read(), InputError, "expected image.name in annolist[0], got none, in ");
  mat::write_mat(annotations_, "RELEASE", mat::number(1));
  EXPECT_THROWS(read(), InputError, "expected images in RELEASE.annolist");
}

/// Without compression there is no checksum: some changes give other labels, but none may end the
/// program, take memory without bound, or let bytes from elsewhere in the file into the labels.
TEST_F(MpiiAnnotationsTest, DamageAnywhereIsRefusedByNameOrStaysWhereItIs) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::two_persons(), true, "a/00000007.jpg"}},
                  MAT_COMPRESSION_NONE);
  const std::string sound = read().at(0).json;
  for (const auto& file : {annotations_, keyframes_}) {
    const std::string whole = read_file(file);
    int refused = 0;
    const auto attempt = [&](const std::string& bytes) {
      write_file(file, bytes);
      try {
        for (const MpiiEntry& entry : read()) {
          EXPECT_LE(entry.json.size(), sound.size() + 64);
        }
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), HasSubstr(file.filename().string()));
        ++refused;
      }
    };
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ std::array{0x01, 0x80, 0xff}[at % 3]);
      attempt(bytes);
    }
    EXPECT_GT(refused, static_cast<int>(whole.size() / 3));
    refused = 0;
    int attempts = 0;
    for (std::size_t size = 0; size < whole.size(); size += 7, ++attempts) {
      attempt(whole.substr(0, size));
    }
    EXPECT_EQ(refused, attempts);
    write_file(file, whole);
  }
}

}  // namespace
}  // namespace eventgan

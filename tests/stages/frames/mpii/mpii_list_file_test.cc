#include <sys/stat.h>

#include <stdexcept>

#include "stages/frames/mpii/detail/mpii_list_dataset.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/testing/hdf5_file.h"

namespace eventgan {
namespace {

using testing::write_hdf5;

using Numbers = std::vector<double>;

class MpiiTableTest : public FolderTest {
 protected:
  MpiiList read() const { return read_mpii_table(file_); }

  fs::path file_ = at("t.h5");
};

TEST_F(MpiiTableTest, ReadsColumnsOfAnyRankAsFieldsOfTheRows) {
  write_hdf5(file_, {{"imgname", {{2}, Texts{"a.jpg", "long.jpg"}, 8}},
                     {"part", {{2, 1, 2}, Numbers{1, 2, 3, 4}}},
                     {"scale", {{2}, Numbers{0.5, std::nan("")}}}});
  const MpiiList list = read();
  EXPECT_EQ(list.form, MpiiListForm::kTable);
  ASSERT_EQ(list.rows.size(), 2u);
  EXPECT_EQ(list.rows[0].dump(), R"({"imgname":"a.jpg","part":[[1.0,2.0]],"scale":0.5})");
  EXPECT_EQ(list.rows[1].dump(), R"({"imgname":"long.jpg","part":[[3.0,4.0]],"scale":null})");
  EXPECT_THAT(list.notes, IsEmpty());
}

TEST_F(MpiiTableTest, NamesMayBeVariableTextOrCodes) {
  const auto names = [&](const testing::Hdf5Dataset& column) {
    write_hdf5(file_, {{"imgname", column}});
    return Texts{read().rows.at(0)["imgname"], read().rows.at(1)["imgname"]};
  };
  EXPECT_THAT(names({{2}, Texts{"a.jpg", ""}}), ElementsAre("a.jpg", ""));
  EXPECT_THAT(names({{2, 3}, Numbers{'a', 'b', 0, 'x', 'y', 'z'}}), ElementsAre("ab", "xyz"));
}

TEST_F(MpiiTableTest, NotesColumnsOfAnotherLength) {
  write_hdf5(file_, {{"imgname", {{2}, Texts{"a.jpg", "b.jpg"}}},
                     {"latin", {{2}, Texts{"\xe9", ""}}},
                     {"mean", {{3}, Numbers{1, 2, 3}}}});
  EXPECT_FALSE(read().rows[0].contains("mean"));
  EXPECT_THAT(read().notes, ElementsAre(AllOf(HasSubstr("column mean left out"),
                                              HasSubstr("expected 2 rows"), HasSubstr("got [3]")),
                                        HasSubstr("column latin left out (expected 2 rows of "
                                                  "numbers or text, got text that is not UTF-8")));
}

TEST_F(MpiiTableTest, RefusesDamagedFilesAndTablesWithoutNames) {
  write_hdf5(file_, {{"scale", {{1}, Numbers{1}}}});
  EXPECT_THROWS(read(), InputError, "expected a column imgname, got none", "t.h5");
  const std::string bytes = read_file(file_);
  write_file(file_, bytes.substr(0, bytes.size() / 2));
  EXPECT_THROWS(read(), InputError, "expected a whole HDF5 file");
}

class MpiiListFileTest : public FolderTest {
 protected:
  void expect_refused(const std::string& bytes, const std::string& message) const {
    write_file(file_, bytes);
    EXPECT_THROWS(read_mpii_list(file_), InputError, message, "list.json") << bytes.substr(0, 99);
  }

  fs::path file_ = at("list.json");
};

TEST_F(MpiiListFileTest, ReadsAJsonListWithEveryField) {
  write_file(file_, R"([{"z": 1.25, "image": "a.jpg", "extra": {"k": []}}])");
  const MpiiList list = read_mpii_list(file_);
  EXPECT_EQ(list.form, MpiiListForm::kJsonList);
  ASSERT_EQ(list.rows.size(), 1u);
  EXPECT_EQ(list.rows[0].dump(), R"({"z":1.25,"image":"a.jpg","extra":{"k":[]}})");
  write_file(file_, "[]");
  EXPECT_TRUE(read_mpii_list(file_).rows.empty());
}

TEST_F(MpiiListFileTest, KnowsATableByItsBytesNotItsName) {
  testing::write_hdf5(file_, {{"imgname", {{1}, std::vector<std::string>{"a.jpg"}}}});
  EXPECT_EQ(read_mpii_list(file_).form, MpiiListForm::kTable);
}

TEST_F(MpiiListFileTest, RefusesWhatIsNeitherAndDoubleKeysAndNestingWithoutEnd) {
  expect_refused("", "got nothing readable");
  expect_refused("{", "expected a JSON list of people or an HDF5 table");
  expect_refused(R"([{"image": "a.jpg"}] x)", "expected a JSON list of people or an HDF5 table");
  expect_refused(R"({"images": []})", "expected a JSON list of people, got one object");
  expect_refused(R"([{"image": "a.jpg"}, {"image": ""}])", "(row 1)");
  expect_refused(R"([{"imgname": "a.jpg"}])", "expected an image's name under \"image\"");
  expect_refused("[3]", "(row 0)");
  expect_refused(R"([{"image": "a.jpg", "scale": 1, "scale": 2}])",
                 "$[0].scale: expected the key once, got it twice");
  expect_refused("[{\"image\": \"a.jpg\", \"center\": " + std::string(100'000, '[') +
                     std::string(100'000, ']') + "}]",
                 "expected at most 32 levels of nesting, got more");
}

TEST_F(MpiiListFileTest, TakesRegularFilesOnlyAndNeverWaits) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THROWS(read_mpii_list(file_), InputError, "nothing readable (Not a regular file)");
}

using Json = nlohmann::ordered_json;

/// A row whose sixteen joints are all (5, 6) and visible but for joint 3.
Json row_with(MpiiListForm form, const Json& joint3, const Json& visible3) {
  Json joints = Json::array(), visible = Json::array();
  for (int i = 0; i < 16; ++i) {
    joints.push_back(i == 3 ? joint3 : Json{5, 6});
    visible.push_back(i == 3 ? visible3 : Json(1));
  }
  const bool is_table = form == MpiiListForm::kTable;
  return {{image_field(form), "a.jpg"},
          {"center", {966.0, 340.5}},
          {"scale", 4.7},
          {is_table ? "part" : "joints", joints},
          {is_table ? "visible" : "joints_vis", visible}};
}

TEST(MpiiListRow, EveryCoordinateLosesOne) {
  for (const auto form : {MpiiListForm::kJsonList, MpiiListForm::kTable}) {
    const Person person = parse_mpii_list_row(row_with(form, {10.5, 0.5}, 0), form);
    ASSERT_EQ(person.joints.size(), 16u);
    EXPECT_EQ(person.joints[0], (Joint{{4, 5}, 1}));
    EXPECT_EQ(person.joints[3], (Joint{{9.5, -0.5}, 0}));
    EXPECT_EQ(person.center, (Point{965, 339.5}));
    EXPECT_EQ(person.scale, 4.7);
    EXPECT_FALSE(person.head_box);
  }
}

TEST(MpiiListRow, EachFormMarksMissingJointsItsOwnWay) {
  const Joint missing{kMissingPoint, 0};
  const auto joint3 = [](MpiiListForm form, const Json& at, int visible = 0) {
    return parse_mpii_list_row(row_with(form, at, visible), form).joints[3];
  };
  EXPECT_EQ(joint3(MpiiListForm::kJsonList, {-1.0, -1.0}), missing);
  EXPECT_EQ(joint3(MpiiListForm::kTable, {0.0, 0.0}), missing);
  EXPECT_EQ(joint3(MpiiListForm::kTable, {0, 0}, 1), missing) << "it is never visible";
  // What marks a missing joint in one form is a place in the other; so is a zero in one coordinate.
  EXPECT_EQ(joint3(MpiiListForm::kTable, {-1.0, -1.0}).at, (Point{-2, -2}));
  EXPECT_EQ(joint3(MpiiListForm::kTable, {325.0, 0.0}).at, (Point{324, -1}));
}

TEST(MpiiListRow, TestImagesHaveNoJoints) {
  const Person person = parse_mpii_list_row(
      {{"image", "a.jpg"}, {"center", {-1, -1}}, {"scale", -1}}, MpiiListForm::kJsonList);
  EXPECT_EQ(person.joints, std::vector<Joint>(16, Joint{kMissingPoint, 0}));
  EXPECT_EQ(person.center, kMissingPoint);
  EXPECT_EQ(person.scale, -1);
}

TEST(MpiiListRow, JointsWithoutVisibilityAreOfUnknownVisibility) {
  Json row = row_with(MpiiListForm::kJsonList, {-1, -1}, 0);
  row.erase("joints_vis");
  const Person person = parse_mpii_list_row(row, MpiiListForm::kJsonList);
  EXPECT_EQ(person.joints[0].visible, -1);
  EXPECT_EQ(person.joints[3].visible, 0);
}

TEST(MpiiListRow, RefusesMalformedRows) {
  const auto form = MpiiListForm::kJsonList;
  const auto with = [&](const char* key, const Json& value) {
    Json row = row_with(form, {1, 2}, 1);
    row[key] = value;
    return row;
  };
  Json fifteen = row_with(form, {1, 2}, 1);
  fifteen["joints"].erase(0);
  const std::pair<Json, const char*> cases[] = {
      {row_with(form, {1, nullptr}, 1), "expected two finite numbers, got [1,null] at joints[3]"},
      {row_with(form, {1, 2, 3}, 1), "expected two finite numbers"},
      {row_with(form, {1, 2}, 0.5), "expected 0 or 1, got 0.5 at joints_vis[3]"},
      {fifteen, "expected 16 elements"},
      {with("joints_vis", 1), "expected 16 elements, got 1 at joints_vis"},
      {with("scale", "4"), "expected a finite number, got \"4\" at scale"},
      {with("center", 7), "expected two finite numbers, got 7 at center"}};
  for (const auto& [row, message] : cases) {
    EXPECT_THROWS(parse_mpii_list_row(row, form), std::invalid_argument, message);
  }
}

}  // namespace
}  // namespace eventgan

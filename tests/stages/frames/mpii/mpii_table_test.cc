#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/faults.h"
#include "stages/frames/mpii/mpii_table_internal.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;
using testing::write_hdf5;

using Numbers = std::vector<double>;
using Texts = std::vector<std::string>;

class MpiiTableTest : public ::testing::Test {
 protected:
  MpiiList read() const { return read_mpii_table(file_); }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "t.h5";
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
  write_hdf5(file_, {{"imgname", {{2}, Texts{"a.jpg", ""}}}});
  EXPECT_EQ(read().rows[0]["imgname"], "a.jpg");
  EXPECT_EQ(read().rows[1]["imgname"], "");
  write_hdf5(file_, {{"imgname", {{2, 3}, Numbers{'a', 'b', 0, 'x', 'y', 'z'}}}});
  EXPECT_EQ(read().rows[0]["imgname"], "ab");
  EXPECT_EQ(read().rows[1]["imgname"], "xyz");
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
  EXPECT_THAT([&] { read(); },
              ThrowsMessage<InputError>(
                  AllOf(HasSubstr("expected a column imgname, got none"), HasSubstr("t.h5"))));
  const std::string bytes = testing::read_file(file_);
  testing::write_file(file_, bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT([&] { read(); }, ThrowsMessage<InputError>(HasSubstr("expected a whole HDF5 file")));
}

}  // namespace
}  // namespace eventgan

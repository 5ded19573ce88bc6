#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "manifests/faults.h"
#include "stages/frames/mpii/mpii_list_file_internal.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class MpiiListFileTest : public ::testing::Test {
 protected:
  void expect_refused(const std::string& bytes, const std::string& message) const {
    testing::write_file(file_, bytes);
    EXPECT_THAT([&] { read_mpii_list(file_); },
                ThrowsMessage<InputError>(AllOf(HasSubstr(message), HasSubstr("list.json"))))
        << bytes;
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "list.json";
};

TEST_F(MpiiListFileTest, ReadsAJsonListWithEveryField) {
  testing::write_file(file_, R"([{"z": 1.25, "image": "a.jpg", "extra": {"k": []}}])");
  const MpiiList list = read_mpii_list(file_);
  EXPECT_EQ(list.form, MpiiListForm::kJsonList);
  ASSERT_EQ(list.rows.size(), 1u);
  EXPECT_EQ(list.rows[0].dump(), R"({"z":1.25,"image":"a.jpg","extra":{"k":[]}})");
  testing::write_file(file_, "[]");
  EXPECT_TRUE(read_mpii_list(file_).rows.empty());
}

TEST_F(MpiiListFileTest, KnowsATableByItsBytesNotItsName) {
  testing::write_hdf5(file_, {{"imgname", {{1}, std::vector<std::string>{"a.jpg"}}}});
  EXPECT_EQ(read_mpii_list(file_).form, MpiiListForm::kTable);
}

TEST_F(MpiiListFileTest, RefusesWhatIsNeither) {
  expect_refused("", "got nothing readable");
  expect_refused("{", "expected a JSON list of people or an HDF5 table");
  expect_refused(R"([{"image": "a.jpg"}] x)", "expected a JSON list of people or an HDF5 table");
  expect_refused(R"({"images": []})", "expected a JSON list of people, got one object");
  expect_refused(R"([{"image": "a.jpg"}, {"image": ""}])", "(row 1)");
  expect_refused(R"([{"imgname": "a.jpg"}])", "expected an image's name under \"image\"");
  expect_refused("[3]", "(row 0)");
}

TEST_F(MpiiListFileTest, RefusesDoubleKeysAndNestingWithoutEnd) {
  expect_refused(R"([{"image": "a.jpg", "scale": 1, "scale": 2}])",
                 "$[0].scale: expected the key once, got it a second time");
  expect_refused("[{\"image\": \"a.jpg\", \"center\": " + std::string(100'000, '[') +
                     std::string(100'000, ']') + "}]",
                 "expected at most 32 levels of nesting, got more");
}

TEST_F(MpiiListFileTest, TakesRegularFilesOnlyAndNeverWaits) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT([&] { read_mpii_list(file_); },
              ThrowsMessage<InputError>(HasSubstr("nothing readable (Not a regular file)")));
}

}  // namespace
}  // namespace eventgan

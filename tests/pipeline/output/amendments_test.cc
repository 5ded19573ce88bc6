#include "pipeline/folder/amendments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

const std::string kPlan(64, 'a');
const Amendment kFirst{{{"frames", "f1"}}, {"000001", "000007"}};
const Amendment kSecond{{{"frames", "f2"}, {"annotations", "a2"}}, {"000003"}};

TEST(Amendments, AreNoneAtFirst) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(read_amendments(folder.path(), kPlan), IsEmpty());
}

TEST(Amendments, AreReadInTheOrderOfTheirRecording) {
  const testing::TemporaryFolder folder;
  record_amendment(folder.path(), kPlan, kFirst);
  EXPECT_THAT(read_amendments(folder.path(), kPlan), ElementsAre(kFirst));
  record_amendment(folder.path(), kPlan, kSecond);
  EXPECT_THAT(read_amendments(folder.path(), kPlan), ElementsAre(kFirst, kSecond));
}

TEST(Amendments, RecordedAtOnceAreAllThere) {
  const testing::TemporaryFolder folder;
  constexpr int kWriters = 8;
  std::vector<std::thread> writers;
  for (int i = 0; i < kWriters; ++i) {
    writers.emplace_back([&, i] {
      record_amendment(folder.path(), kPlan, {{{"frames", "f"}}, {std::to_string(i)}});
    });
  }
  for (std::thread& writer : writers) writer.join();
  std::vector<std::string> samples;
  for (const Amendment& one : read_amendments(folder.path(), kPlan)) {
    samples.push_back(one.samples.at(0));
  }
  EXPECT_THAT(samples, ::testing::UnorderedElementsAre("0", "1", "2", "3", "4", "5", "6", "7"));
}

TEST(Amendments, OfAnotherPlanDoNotCountAndMakeRoom) {
  const testing::TemporaryFolder folder;
  const std::string other(64, 'b');
  record_amendment(folder.path(), other, kFirst);
  EXPECT_THAT(read_amendments(folder.path(), kPlan), IsEmpty());
  record_amendment(folder.path(), kPlan, kSecond);
  EXPECT_THAT(read_amendments(folder.path(), kPlan), ElementsAre(kSecond));
  EXPECT_THAT(read_amendments(folder.path(), other), IsEmpty());
}

TEST(Amendments, ThatAreDamagedAreAnErrorNamingTheFile) {
  const testing::TemporaryFolder folder;
  record_amendment(folder.path(), kPlan, kFirst);
  const std::string text = testing::read_file(folder / "amendments.json");
  testing::write_file(folder / "amendments.json", text.substr(0, text.size() / 2));
  EXPECT_THAT([&] { read_amendments(folder.path(), kPlan); },
              ThrowsMessage<std::runtime_error>(HasSubstr("amendments.json")));
  testing::write_file(folder / "amendments.json", "");
  EXPECT_THROW(read_amendments(folder.path(), kPlan), std::runtime_error);
  EXPECT_THROW(record_amendment(folder.path(), kPlan, kSecond), std::runtime_error);
  std::filesystem::remove(folder / "amendments.json");
  std::filesystem::create_directory(folder / "amendments.json");
  EXPECT_THAT([&] { read_amendments(folder.path(), kPlan); },
              ThrowsMessage<std::runtime_error>(HasSubstr("amendments.json")));
}

TEST(Amendments, MayNotChangeWhatTheJobIs) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(record_amendment(folder.path(), kPlan, {{{"weights", "w"}}, {}}),
               std::invalid_argument);
  record_amendment(folder.path(), kPlan, kFirst);
  std::string text = testing::read_file(folder / "amendments.json");
  text.replace(text.find("frames"), 6, "weights");
  testing::write_file(folder / "amendments.json", text);
  EXPECT_THAT([&] { read_amendments(folder.path(), kPlan); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("expected fields that may change: annotations, frames, got weights")));
}

TEST(IsAmendable, HoldsForWhatIsReadFromInputs) {
  EXPECT_TRUE(is_amendable("frames"));
  EXPECT_TRUE(is_amendable("annotations"));
  for (const char* field : {"weights", "engine", "cpu", "manifest $.seed", "", "frame"}) {
    EXPECT_FALSE(is_amendable(field)) << field;
  }
}

TEST(Amended, TakesTheNewestValueOfAField) {
  EXPECT_THAT(amended({{"frames", "f0"}, {"annotations", "a0"}, {"weights", "w"}}, {kFirst}),
              ElementsAre(::testing::Pair("annotations", "a0"), ::testing::Pair("frames", "f1"),
                          ::testing::Pair("weights", "w")));
  EXPECT_THAT(amended({{"frames", "f0"}}, {kFirst, kSecond}),
              ElementsAre(::testing::Pair("annotations", "a2"), ::testing::Pair("frames", "f2")));
  EXPECT_THAT(amended({{"frames", "f0"}}, {}), ElementsAre(::testing::Pair("frames", "f0")));
}

}  // namespace
}  // namespace eventgan

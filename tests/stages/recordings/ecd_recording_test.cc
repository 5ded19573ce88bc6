#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "stages/recordings/ecd_recording_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

class EcdRecordingTest : public ::testing::Test {
 protected:
  EcdRecordingTest() {
    write("images.txt", "1.0 a.pgm\n1.5 b.pgm\n2.0 c.pgm\n");
    write("a.pgm", "P5 4 3 255\n" + std::string(12, '\x0a'));
    write("b.pgm", "P5 4 3 255\n" + std::string(12, '\x14'));
    write("c.pgm", "P5 4 3 255\n" + std::string(12, '\xff'));
    write("events.txt",
          "0.5 0 0 1\n1.0 1 0 0\n1.25 2 1 1\n1.25 3 2 0\n1.75 0 2 1\n2.0 3 0 1\n2.5 1 1 0\n");
  }
  void write(const std::string& name, const std::string& bytes) {
    testing::write_file(folder_ / name, bytes);
  }
  EcdRecording open() { return EcdRecording(folder_.path()); }

  testing::TemporaryFolder folder_;
};

TEST_F(EcdRecordingTest, ReadsFramesAndTimes) {
  const EcdRecording recording = open();
  EXPECT_EQ(recording.name(), folder_.path().string());
  EXPECT_EQ(recording.size(), (ImageSize{3, 4}));
  EXPECT_EQ(recording.frame_count(), 3);
  EXPECT_EQ(recording.frame_time_s(1), 1.5);
  EXPECT_EQ(recording.frame(0).size, (ImageSize{3, 4}));
  EXPECT_THAT(recording.frame(0).pixels, Each(10));
  EXPECT_THAT(recording.frame(2).pixels, Each(255));
  EXPECT_FALSE(recording.flow(0).has_value());
}

TEST_F(EcdRecordingTest, ReadsEventsAfterAFrameUpToAnother) {
  const EcdRecording recording = open();
  EXPECT_EQ(recording.events_between(0, 1),
            (std::vector<Event>{{2, 1, 1.25, true}, {3, 2, 1.25, false}}));
  EXPECT_EQ(recording.events_between(1, 2),
            (std::vector<Event>{{0, 2, 1.75, true}, {3, 0, 2.0, true}}));
  EXPECT_EQ(recording.events_between(0, 2).size(), 4u);
  EXPECT_THAT(recording.events_between(1, 1), IsEmpty());
}

TEST_F(EcdRecordingTest, GivesFewerEventsWhereThereAreNone) {
  write("events.txt", "1.6 0 0 1\n");
  EXPECT_THAT(open().events_between(0, 1), IsEmpty());
  EXPECT_EQ(open().events_between(0, 2).size(), 1u);
  write("events.txt", "");
  EXPECT_THAT(open().events_between(0, 2), IsEmpty());
}

TEST_F(EcdRecordingTest, RefusesFramesThatAreNotThere) {
  const EcdRecording recording = open();
  EXPECT_THROW(recording.frame(3), std::out_of_range);
  EXPECT_THROW(recording.frame_time_s(-1), std::out_of_range);
  EXPECT_THROW(recording.events_between(1, 0), std::out_of_range);
  EXPECT_THROW(recording.flow(2), std::out_of_range);
}

TEST_F(EcdRecordingTest, MakesColourGreyAndSaysSo) {
  EXPECT_THAT(open().notes(), IsEmpty());
  // ITU-R BT.601: 0.299 x 200 + 0.587 x 100 + 0.114 x 50 = 124.2.
  std::string colour = "P6 4 3 255\n";
  for (int pixel = 0; pixel < 12; ++pixel) colour += "\xc8\x64\x32";
  write("b.pgm", colour);
  const EcdRecording late = open();
  EXPECT_THAT(late.notes(), IsEmpty());
  EXPECT_THAT(late.frame(1).pixels, Each(124));
  EXPECT_THAT(late.notes(),
              ElementsAre("frames in colour are made grey, in " + (folder_ / "b.pgm").string()));
  write("a.pgm", colour);
  EXPECT_THAT(open().notes(), ElementsAre(HasSubstr("a.pgm")));
}

TEST_F(EcdRecordingTest, RefusesOtherSizesAndDamage) {
  write("c.pgm", "P5 3 4 255\n" + std::string(12, '\x0a'));
  const EcdRecording recording = open();
  EXPECT_THAT([&] { recording.frame(2); },
              ThrowsMessage<InputError>(HasSubstr("one size, 4x3, got 3x4")));
  write("c.pgm", "no picture");
  EXPECT_THAT([&] { recording.frame(2); }, ThrowsMessage<InputError>(HasSubstr("c.pgm")));
}

TEST_F(EcdRecordingTest, OpensOnlyWholeFolders) {
  EXPECT_THAT([&] { EcdRecording recording(folder_ / "absent"); },
              ThrowsMessage<InputError>(HasSubstr("expected a folder with images.txt")));
  std::filesystem::remove(folder_ / "c.pgm");
  EXPECT_THAT([&] { open(); },
              ThrowsMessage<InputError>(HasSubstr((folder_ / "c.pgm").string() + " (frame 2)")));
  write("images.txt", "1.0 a.pgm\n");
  EXPECT_EQ(open().frame_count(), 1);
  EXPECT_THAT(open().events_between(0, 0), IsEmpty());
  std::filesystem::remove(folder_ / "events.txt");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("events.txt")));
  write("a.pgm", "no picture");
  write("events.txt", "");
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("a.pgm")));
}

}  // namespace
}  // namespace eventgan

#include "stages/frames/sources/frame_selection.h"

#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

TEST(FrameOriginTest, IsWhatTheSequencesNameTells) {
  EXPECT_EQ(frame_origin(DatasetKind::kHuman36m, "S1/Directions-1/54138969"),
            (FrameOrigin{"S1", "Directions-1", "54138969", ""}));
  EXPECT_EQ(frame_origin(DatasetKind::kHuman36m, "S11_Walking_1.60457274"),
            (FrameOrigin{"S11", "Walking_1", "60457274", ""}));
  EXPECT_EQ(frame_origin(DatasetKind::kHuman36m, "odd"), FrameOrigin());
  EXPECT_EQ(frame_origin(DatasetKind::kKittiObject, "2011_09_26_drive_0052_sync").drive,
            "2011_09_26_drive_0052_sync");
  EXPECT_EQ(frame_origin(DatasetKind::kMpii, "000000001"), FrameOrigin());
}

/// Subjects S1 and S5, of each two actions seen by cameras 7 and 8, three frames each.
class FrameSelectionTest : public FolderTest {
 protected:
  FrameSelectionTest() {
    spec_.dataset = DatasetKind::kHuman36m;
    spec_.root = "h36m";
    for (const char* subject : {"S1", "S5"}) {
      for (const char* action : {"/Eating-1", "/Walking-1"}) {
        for (const char* camera : {"/7", "/8"}) {
          for (const char* number : {"/1", "/6", "/11"}) {
            LabelledFrame& frame = frames_.emplace_back();
            frame.sequence = std::string(subject) + action + camera;
            frame.sample_id = frame.sequence + number;
          }
        }
      }
    }
  }

  FrameSelection select() const { return select_frames(frames_, spec_, folder_.path(), 7); }
  std::vector<LabelledFrame> selected() const { return select().frames; }
  Texts ids() const { return ids_of(selected()); }

  std::vector<LabelledFrame> frames_;
  SourceSpec spec_;
};

TEST_F(FrameSelectionTest, TakesAllUnlessAsked) { EXPECT_THAT(selected(), SizeIs(24)); }

TEST_F(FrameSelectionTest, TakesTheIdsOfAListInTheDatasetsOrder) {
  write("ids.txt", "\xEF\xBB\xBF S5/Walking-1/8/11\r\n\nS1/Eating-1/7/6");
  spec_.selection.ids = "ids.txt";
  EXPECT_THAT(ids(), ElementsAre("S1/Eating-1/7/6", "S5/Walking-1/8/11"));
}

TEST_F(FrameSelectionTest, AListMayNameImages) {
  write("val.txt", "./data/S5\\Walking-1\\8\\11.jpg\n/far/away/S1/Eating-1/7/6.PNG\nS1/none.jpg\n");
  spec_.selection.ids = "val.txt";
  EXPECT_THAT(ids(), ElementsAre("S1/Eating-1/7/6", "S5/Walking-1/8/11"));
  EXPECT_THAT(select().notes, ElementsAre("1 image of val.txt not here, or without a label"));
}

TEST_F(FrameSelectionTest, AnIdThatIsNotThereIsAnError) {
  write("ids.txt", "S1/Eating-1/7/6\nS9\n");
  spec_.selection.ids = "ids.txt";
  EXPECT_THROWS(selected(), InputError,
                StrEq("expected sample ids of the source, got 1 that it does not "
                      "have (S9), in ids.txt"));
  spec_.selection.ids = "absent.txt";
  EXPECT_THROWS(selected(), InputError, "absent.txt");
}

TEST_F(FrameSelectionTest, SubjectsCamerasAndActionsMustAllHold) {
  spec_.selection.subjects = {"S5"};
  spec_.selection.cameras = {"7", "8"};
  spec_.selection.actions = {"Walking-1"};
  EXPECT_THAT(selected(), SizeIs(6));
  spec_.selection.cameras = {"7", "9"};
  EXPECT_THROWS(selected(), InputError,
                StrEq("expected cameras of the source, got 1 that it does not have "
                      "(9), in h36m"));
}

TEST_F(FrameSelectionTest, FractionsAreOfWholeSequencesAndComplement) {
  spec_.selection.fraction = {0, 0.5};
  const auto first = ids();
  spec_.selection.fraction = {0.5, 1};
  const auto second = ids();
  EXPECT_EQ(first.size() + second.size(), 24u);
  EXPECT_EQ(first.size() % 3, 0u);
  EXPECT_GT(first.size(), 0u);
  EXPECT_GT(second.size(), 0u);
  for (const std::string& id : first) EXPECT_THAT(second, Not(Contains(id)));
}

TEST_F(FrameSelectionTest, FractionsKeepTheCamerasOfATakeTogether) {
  spec_.selection.fraction = {0, 0.5};
  std::map<std::string, int> frames_of_take;
  for (const std::string& id : ids()) ++frames_of_take[id.substr(0, id.find("-1"))];
  EXPECT_THAT(frames_of_take, Each(Pair(_, 6)));
  EXPECT_THAT(select().notes, IsEmpty());
}

TEST_F(FrameSelectionTest, FramesWithoutASequenceCountByThemselves) {
  for (LabelledFrame& frame : frames_) frame.sequence.clear();
  spec_.selection.fraction = {0, 0.5};
  const std::size_t count = selected().size();
  EXPECT_GT(count, 4u);
  EXPECT_LT(count, 20u);
  EXPECT_THAT(select().notes, ElementsAre(HasSubstr("24 labelled frames without a sequence")));
  spec_.selection.fraction = {0, 1};
  EXPECT_THAT(select().notes, IsEmpty());
}

TEST_F(FrameSelectionTest, OneSequenceIsTakenWholeOrNotAtAll) {
  spec_.dataset = DatasetKind::kFrames;
  for (LabelledFrame& frame : frames_) frame.sequence = "clip";
  int refused = 0;
  for (const double begin : {0.0, 0.5}) {
    spec_.selection.fraction = {begin, begin + 0.5};
    try {
      const FrameSelection taken = select();
      EXPECT_THAT(taken.frames, SizeIs(24));
      EXPECT_THAT(taken.notes,
                  ElementsAre("one sequence, clip, which fraction takes whole or not at all"));
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("one sequence, clip"));
      ++refused;
    }
  }
  EXPECT_EQ(refused, 1);
}

TEST_F(FrameSelectionTest, NothingLeftIsAnError) {
  spec_.selection.fraction = {0, 1e-9};
  EXPECT_THROWS(selected(), InputError, "got none of 24");
  frames_.clear();  // what is wrong with such a source is told elsewhere
  EXPECT_THAT(selected(), IsEmpty());
}

}  // namespace
}  // namespace eventgan

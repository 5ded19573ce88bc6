
#include <atomic>
#include <thread>

#include "stages/frames/decoding/pair_reader.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

// What pairs of one PairReader share.

namespace eventgan {
namespace {

FramePair shared_pair(const std::string& previous, const std::string& next) {
  FramePair pair;
  pair.previous.path = previous;
  pair.next.path = next;
  return pair;
}

std::string why_none(const Outcome<PreparedPair>& outcome) {
  return is_fault(outcome) ? outcome.fault().reason : "no fault";
}

TEST(PairSharing, PairsThatShareAFrameDecodeItOnce) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.png", "c.png"}) {
    cv::imwrite((folder / name).string(), testing::gradient_image({5, 7}) + name[0]);
  }
  const PairReader reader(folder.path(), {});
  const auto first = reader.read(shared_pair("a.png", "b.png"));
  fs::remove(folder / "a.png");  // a second decoding would fail
  fs::remove(folder / "b.png");
  for (const auto& pair : {shared_pair("b.png", "c.png"), shared_pair("a.png", "c.png")}) {
    EXPECT_EQ(why_none(reader.read(pair)), "no fault");
  }
  EXPECT_EQ(reader.read(shared_pair("a.png", "b.png"))->input, first->input);
  EXPECT_THAT(why_none(PairReader(folder.path(), {}).read(shared_pair("a.png", "c.png"))),
              HasSubstr("got 'No such file or directory', in a.png"));
}

TEST(PairSharing, AnExpectedFileIsOpenedOnce) {
  const TemporaryFolder folder;
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    cv::imwrite((folder / name).string(), testing::gradient_image({5, 7}));
  }
  const PairReader reader(folder.path(), {});
  const InputCounter counter;
  for (const auto& pair : {shared_pair("a.png", "b.png"), shared_pair("b.png", "c.png"),
                           shared_pair("none.png", "b.png")}) {
    reader.expect(pair);
  }
  EXPECT_EQ(counter.of(folder / "b.png").opens, 1u);
  EXPECT_EQ(why_none(reader.read(shared_pair("a.png", "b.png"))), "no fault");
  reader.expect(shared_pair("b.png", "a.png"));  // both are kept
  EXPECT_EQ(why_none(reader.read(shared_pair("b.png", "c.png"))), "no fault");
  EXPECT_THAT(why_none(reader.read(shared_pair("none.png", "b.png"))),
              HasSubstr("got 'No such file or directory', in none.png"));
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    EXPECT_EQ(counter.of(folder / name).opens, 1u) << name;
  }
}

TEST(FilesAhead, OfTooManyTheOneThatWaitedLongestIsClosed) {
  const TemporaryFolder folder;
  for (std::size_t i = 0; i <= FilesAhead::kMost; ++i) {
    write_file(folder / std::to_string(i), "x");
  }
  FilesAhead ahead;
  const InputCounter counter;
  const auto opens = [&](std::size_t i) { return counter.of(folder / std::to_string(i)).opens; };
  for (std::size_t i = 0; i <= FilesAhead::kMost; ++i) ahead.expect(folder / std::to_string(i));
  for (std::size_t i = 0; i <= FilesAhead::kMost; ++i) {
    EXPECT_EQ(ahead.take(folder / std::to_string(i)).read_all(), "x");
    EXPECT_EQ(opens(i), i == 0 ? 2u : 1u);
  }
  ahead.take(folder / "1");
  EXPECT_EQ(opens(1), 2u);
}

TEST(PairSharing, SharedFramesMakeTheSameInputsAsUnsharedOnes) {
  const TemporaryFolder folder;
  for (int i = 0; i < 6; ++i) {
    cv::imwrite((folder / std::to_string(i)).string() + ".png",
                testing::gradient_image({40, 50}) + cv::Scalar::all(20 * i));
  }
  ImageSpec spec;
  spec.size = ImageSize{20, 30};
  spec.blur = 3;
  const PairReader sharing(folder.path(), spec);
  for (int next = 1; next < 6; ++next) {
    for (int previous = 0; previous < next; ++previous) {
      const auto pair =
          shared_pair(std::to_string(previous) + ".png", std::to_string(next) + ".png");
      EXPECT_EQ(sharing.read(pair)->input, PairReader(folder.path(), spec).read(pair)->input);
    }
  }
}

TEST(PairSharing, ABadFrameIsTheSameFaultForEachOfItsPairs) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), testing::gradient_image({5, 7}));
  cv::imwrite((folder / "c.png").string(), testing::gradient_image({5, 7}));
  cv::imwrite((folder / "b.png").string(), testing::gradient_image({5, 7}));
  fs::resize_file(folder / "b.png", 60);
  const PairReader reader(folder.path(), {});
  const std::string first = why_none(reader.read(shared_pair("a.png", "b.png")));
  EXPECT_THAT(first, HasSubstr("expected a whole PNG, got "));
  EXPECT_THAT(first, HasSubstr(", in b.png"));
  EXPECT_EQ(why_none(reader.read(shared_pair("b.png", "c.png"))), first);
  EXPECT_EQ(why_none(reader.read(shared_pair("a.png", "c.png"))), "no fault");
}

TEST(PairSharing, ManyThreadsGetTheInputsThatOneThreadGets) {
  const TemporaryFolder folder;
  constexpr int kFrames = 10;
  testing::write_counting_video(folder / "clip.avi", kFrames);
  std::vector<FramePair> pairs;
  for (int i = 0; i < kFrames; ++i) {
    const std::string name = std::to_string(i) + ".png";
    cv::imwrite((folder / name).string(),
                testing::gradient_image({30, 40}) + cv::Scalar::all(10 * i));
    for (int gap = 1; gap <= std::min(i, 6); ++gap) {
      pairs.push_back(shared_pair(std::to_string(i - gap) + ".png", name));
      pairs.emplace_back();
      pairs.back().previous = testing::video_ref("clip.avi", i - gap);
      pairs.back().next = testing::video_ref("clip.avi", i);
    }
  }
  std::vector<std::vector<float>> expected;
  const PairReader one(folder.path(), {});
  for (const auto& pair : pairs) {
    expected.push_back(one.read(pair)->input);
  }

  const PairReader reader(folder.path(), {}, 1);  // little room, so frames are made again as well
  std::atomic<int> wrong = 0;
  std::atomic<std::size_t> taken = 0;
  std::vector<std::thread> threads;
  for (int worker = 0; worker < 8; ++worker) {
    threads.emplace_back([&] {
      for (std::size_t i = taken++; i < pairs.size(); i = taken++) {
        const auto outcome = reader.read(pairs[i]);
        wrong += is_fault(outcome) || outcome->input != expected[i];
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

// Of a source that is turned upright and one that is not.
TEST(PairSharing, OneFileIsTakenAsStoredAndUpright) {
  const TemporaryFolder folder;
  const auto file = folder / "a.jpg";
  cv::imwrite(file.string(), testing::gradient_image({20, 36}));
  write_file(file, testing::with_orientation(read_file(file), 6));
  const PairReader reader(folder.path(), {});
  const FramePair pair = shared_pair("a.jpg", "a.jpg");
  for (int turn = 0; turn < 2; ++turn) {
    const auto stored = *reader.read(pair);
    EXPECT_EQ(stored.content, (ImageSize{20, 36}));
    const auto upright = *reader.read(pair, ImageOrientation::kUpright);
    EXPECT_EQ(upright.content, (ImageSize{36, 20}));
    EXPECT_EQ(upright.placement.source, (ImageSize{36, 20}));
    // Turned by 90 degrees clockwise, the bottom left pixel comes to lie at the top left, and the
    // top left one at the top right.
    EXPECT_EQ(upright.input[0], stored.input[19 * 36]);
    EXPECT_EQ(upright.input[19], stored.input[0]);
    EXPECT_NE(upright.input[0], upright.input[19]);
  }
  write_file(folder / "b.jpg", testing::with_orientation(read_file(file), 2));
  EXPECT_EQ(why_none(reader.read(shared_pair("b.jpg", "b.jpg"), ImageOrientation::kUpright)),
            "expected an image that is not mirrored, got EXIF orientation 2, in b.jpg");
  EXPECT_EQ(why_none(reader.read(shared_pair("b.jpg", "b.jpg"))), "no fault");
}

}  // namespace
}  // namespace eventgan

// What pairs of one PairReader share.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "stages/frames/decoding/pair_reader.h"
#include "tests/stages/frames/decoding/test_pictures.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

FramePair pair_of(const std::string& previous, const std::string& next) {
  FramePair pair;
  pair.previous.path = previous;
  pair.next.path = next;
  return pair;
}

std::string reason(const Outcome<PreparedPair>& outcome) {
  return is_fault(outcome) ? std::get<SampleFault>(outcome).reason : "no fault";
}

TEST(PairSharing, PairsThatShareAFrameDecodeItOnce) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.png", "c.png"}) {
    cv::imwrite((folder / name).string(), testing::gradient_picture({5, 7}) + name[0]);
  }
  const PairReader reader(folder.path(), {});
  const auto first = reader.read(pair_of("a.png", "b.png"));
  std::filesystem::remove(folder / "a.png");  // a second decoding would fail
  std::filesystem::remove(folder / "b.png");
  for (const auto& pair : {pair_of("b.png", "c.png"), pair_of("a.png", "c.png")}) {
    EXPECT_EQ(reason(reader.read(pair)), "no fault");
  }
  EXPECT_EQ(std::get<PreparedPair>(reader.read(pair_of("a.png", "b.png"))).input,
            std::get<PreparedPair>(first).input);
  EXPECT_THAT(reason(PairReader(folder.path(), {}).read(pair_of("a.png", "c.png"))),
              HasSubstr("got none, in a.png"));
}

TEST(PairSharing, SharedFramesMakeTheSameInputsAsUnsharedOnes) {
  const TemporaryFolder folder;
  for (int i = 0; i < 6; ++i) {
    cv::imwrite((folder / std::to_string(i)).string() + ".png",
                testing::gradient_picture({40, 50}) + cv::Scalar::all(20 * i));
  }
  ImageSpec spec;
  spec.size = ImageSize{20, 30};
  spec.blur = 3;
  const PairReader sharing(folder.path(), spec);
  for (int next = 1; next < 6; ++next) {
    for (int previous = 0; previous < next; ++previous) {
      const auto pair = pair_of(std::to_string(previous) + ".png", std::to_string(next) + ".png");
      EXPECT_EQ(std::get<PreparedPair>(sharing.read(pair)).input,
                std::get<PreparedPair>(PairReader(folder.path(), spec).read(pair)).input);
    }
  }
}

TEST(PairSharing, ABadFrameIsTheSameFaultForEachOfItsPairs) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), testing::gradient_picture({5, 7}));
  cv::imwrite((folder / "c.png").string(), testing::gradient_picture({5, 7}));
  cv::imwrite((folder / "b.png").string(), testing::gradient_picture({5, 7}));
  std::filesystem::resize_file(folder / "b.png", 60);
  const PairReader reader(folder.path(), {});
  const std::string first = reason(reader.read(pair_of("a.png", "b.png")));
  EXPECT_THAT(first, HasSubstr("expected a whole PNG, got "));
  EXPECT_THAT(first, HasSubstr(", in b.png"));
  EXPECT_EQ(reason(reader.read(pair_of("b.png", "c.png"))), first);
  EXPECT_EQ(reason(reader.read(pair_of("a.png", "c.png"))), "no fault");
}

TEST(PairSharing, ManyThreadsGetTheInputsThatOneThreadGets) {
  const TemporaryFolder folder;
  constexpr int kFrames = 10;
  testing::write_counting_video(folder / "clip.avi", kFrames);
  std::vector<FramePair> pairs;
  for (int i = 0; i < kFrames; ++i) {
    const std::string name = std::to_string(i) + ".png";
    cv::imwrite((folder / name).string(),
                testing::gradient_picture({30, 40}) + cv::Scalar::all(10 * i));
    for (int gap = 1; gap <= std::min(i, 6); ++gap) {
      pairs.push_back(pair_of(std::to_string(i - gap) + ".png", name));
      pairs.emplace_back();
      pairs.back().previous = testing::video_ref("clip.avi", i - gap);
      pairs.back().next = testing::video_ref("clip.avi", i);
    }
  }
  std::vector<std::vector<float>> expected;
  const PairReader one(folder.path(), {});
  for (const auto& pair : pairs) {
    expected.push_back(std::get<PreparedPair>(one.read(pair)).input);
  }

  const PairReader reader(folder.path(), {}, 1);  // little room, so frames are made anew as well
  std::atomic<int> wrong = 0;
  std::atomic<std::size_t> taken = 0;
  std::vector<std::thread> threads;
  for (int worker = 0; worker < 8; ++worker) {
    threads.emplace_back([&] {
      for (std::size_t i = taken++; i < pairs.size(); i = taken++) {
        const auto outcome = reader.read(pairs[i]);
        wrong += is_fault(outcome) || std::get<PreparedPair>(outcome).input != expected[i];
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace eventgan

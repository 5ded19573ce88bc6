#include "pipeline/training/training_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ShownTraining : public ::testing::Test {
 protected:
  /// Three steps of a second each, the discriminator's loss in the second only.
  std::string shown(ProgressStyle style) {
    std::ostringstream stream;
    {
      TrainingProgress progress(stream, style, false, [&] { return now_; });
      for (int done = 1; done <= 3; ++done) {
        now_ += std::chrono::seconds(10);
        progress.advance(TrainingPhase::kGenerator, done, 100,
                         done == 2 ? std::map<std::string, double>{{"discriminator", 1.5}}
                                   : std::map<std::string, double>{{"generator.total", 0.25}});
      }
    }
    return stream.str();
  }

  std::chrono::steady_clock::time_point now_{};
};

TEST_F(ShownTraining, LinesSayPhaseRateAndLosses) {
  EXPECT_THAT(shown(ProgressStyle::kLines),
              HasSubstr("generator 3/100, 0.10 steps/s, 0h16m10s left, generator.total 0.25, "
                        "discriminator 1.5\n"));
}

TEST_F(ShownTraining, ABarIsRedrawnAndEnded) {
  const std::string text = shown(ProgressStyle::kBar);
  EXPECT_THAT(text, HasSubstr("\r[....................] generator 3/100"));
  EXPECT_EQ(text.back(), '\n');
}

TEST_F(ShownTraining, JsonIsALineEach) {
  EXPECT_THAT(shown(ProgressStyle::kJson), HasSubstr("\"phase\":\"generator\""));
  EXPECT_THAT(shown(ProgressStyle::kNone), Not(HasSubstr("generator")));
  EXPECT_THAT(shown(ProgressStyle::kAuto), HasSubstr("generator 1/100"));  // no terminal: lines
}

}  // namespace
}  // namespace eventgan

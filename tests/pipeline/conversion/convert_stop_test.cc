#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/dataset/verify_folder.h"
#include "tests/pipeline/conversion/small_conversion.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr double kLong_s = 1e6;

/// A request to stop that a test makes, and waits until it was heard.
class Request {
 public:
  std::function<std::optional<double>()> since() {
    return [this]() -> std::optional<double> {
      if (!made_) return std::nullopt;
      ++heard_;
      return 0.001;
    };
  }

  void make() { made_ = true; }

  /// Until the order stands that followed from it, if it was to finish the shard: the monitor asks
  /// again after it has set that. After an abort it asks no more.
  void make_and_wait(int times = 2) {
    made_ = true;
    while (heard_ < times) std::this_thread::yield();
  }

 private:
  std::atomic<bool> made_ = false;
  std::atomic<int> heard_ = 0;
};

/// Asks to stop while it makes its `at`th volume.
class StoppingGenerator final : public Generator {
 public:
  StoppingGenerator(Request& request, int at) : request_(request), at_(at) {}
  int bins() const override { return generator_.bins(); }
  std::string description() const override { return generator_.description(); }
  GenerationNotes generate(const GeneratorInput& pair, std::span<float> volume) const override {
    const GenerationNotes notes = generator_.generate(pair, volume);
    if (generator_.calls() == at_) request_.make_and_wait(1);
    return notes;
  }

 private:
  testing::FakeGenerator generator_;
  Request& request_;
  int at_;
};

/// 11 pairs in shards of 4, 4 and 3; "whole" is what an undisturbed run makes.
class ConvertStop : public testing::SmallConversion {
 protected:
  ConvertStop() { run("whole"); }

  /// Asks to stop when `samples` samples are in shards.
  ConversionReport stop_after(int samples, double grace_s, const std::string& output) {
    Request request;
    ConversionOptions stopping = options(output);
    stopping.grace_s = grace_s;
    stopping.since_stop_request = request.since();
    int taken = -1;  // a progress asks its clock when it is made, and for every sample
    stopping.make_progress = [&](std::int64_t total) {
      return std::make_unique<Progress>(nowhere_, ProgressStyle::kNone, nullptr, total, [&] {
        if (taken++ == samples - 1) request.make_and_wait();
        return std::chrono::steady_clock::time_point();
      });
    };
    return run(stopping);
  }

  void expect_only_whole_shards(const ConversionReport& report, const std::string& output) {
    EXPECT_EQ(shards(output).size(), static_cast<std::size_t>(report.shards_done));
    EXPECT_EQ(names(output).size(), 2u + 2 * static_cast<std::size_t>(report.shards_done));
    for (const auto& [name, bytes] : shards(output)) EXPECT_EQ(bytes, shards("whole").at(name));
  }

  std::ostringstream nowhere_;
};

TEST_F(ConvertStop, FinishesTheOpenShardAndStartsNoOther) {
  for (const auto& [samples, shards_done] : {std::pair{1, 1}, {3, 1}, {5, 2}, {7, 2}}) {
    const std::string output = "after" + std::to_string(samples);
    const ConversionReport report = stop_after(samples, kLong_s, output);
    EXPECT_TRUE(report.stopped);
    EXPECT_EQ(report.shards_done, shards_done) << samples;
    EXPECT_EQ(report.written, 4 * shards_done);
    EXPECT_THAT(to_text(report), ::testing::HasSubstr("stopped"));
    expect_only_whole_shards(report, output);
    const ConversionReport rest = run(output);
    EXPECT_TRUE(rest.complete());
    EXPECT_EQ(rest.shards_done_before, shards_done);
    EXPECT_EQ(shards(output), shards("whole"));
  }
}

TEST_F(ConvertStop, ARequestInTheLastShardLetsTheJobEndWhole) {
  const ConversionReport report = stop_after(9, kLong_s, "out");
  EXPECT_TRUE(report.complete());
  EXPECT_FALSE(report.stopped);
  EXPECT_EQ(shards(), shards("whole"));
}

TEST_F(ConvertStop, AtAnyMomentLeavesWholeShardsOnlyAndTheNextRunEndsTheJob) {
  for (const int threads : {1, 3}) {
    for (const double grace_s : {0.0, kLong_s}) {
      for (const int call : {1, 4, 8, 11}) {
        Request request;
        const StoppingGenerator generator(request, call);
        ConversionOptions stopping = options("out", threads);
        stopping.grace_s = grace_s;
        stopping.since_stop_request = request.since();
        const ConversionReport report = convert(manifest_, generator, "weights", stopping);
        EXPECT_NE(report.stopped, report.complete());
        expect_only_whole_shards(report, "out");
        EXPECT_TRUE(run("out", threads).complete());
        EXPECT_EQ(shards(), shards("whole"));
        std::filesystem::remove_all(folder_ / "out");
      }
    }
  }
}

TEST_F(ConvertStop, ARequestWhilePlanningWritesNothing) {
  Request request;
  request.make();
  ConversionOptions stopping = options();
  stopping.since_stop_request = request.since();
  EXPECT_THROWS(run(stopping), Stopped, "stopped while planning; nothing was written: run again");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(ConvertStop, ARequestAfterPlanningMakesNoSample) {
  testing::write_file(out("run.json"), R"({"manifest_folder": "/elsewhere"})");
  Request request;
  ConversionOptions stopping = options();
  stopping.since_stop_request = request.since();
  stopping.note = [&](const std::string&) { request.make(); };  // that the manifest has moved
  const int calls = generator_.calls();
  const ConversionReport report = run(stopping);
  EXPECT_TRUE(report.stopped);
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(generator_.calls(), calls);
  EXPECT_THAT(names(), ::testing::ElementsAre("plan.json", "run.json"));
}

TEST_F(ConvertStop, ARequestWithNothingToDoIsNoStop) {
  run();
  const ConversionReport again = stop_after(0, kLong_s, "out");
  EXPECT_TRUE(again.complete());
  EXPECT_FALSE(again.stopped);
}

}  // namespace
}  // namespace eventgan

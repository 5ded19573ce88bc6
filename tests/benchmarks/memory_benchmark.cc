// Peak memory of a conversion against its number of pairs: it must not grow with them, since the
// limiter spans reader to writer. Runs the program itself, so that the peak is that of a whole run.
//   build/dev/tests/eventgan_memory_benchmark

#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// A conversion of a clip whose frames keep their size.
struct Job {
  int pairs = 0;
  cv::Size size;
  int base_width = 8;  ///< of the untrained network
  int threads = 2;
};

/// A bright square that wanders over a dark ground.
void write_clip(const std::filesystem::path& folder, const Job& job) {
  std::filesystem::create_directories(folder);
  for (int frame = 0; frame <= job.pairs; ++frame) {
    cv::Mat picture(job.size, CV_8UC1, cv::Scalar(60));
    const cv::Point corner(frame * 3 % (job.size.width - 46), frame * 2 % (job.size.height - 40));
    cv::rectangle(picture, cv::Rect(corner, cv::Size(40, 40)), cv::Scalar(200), cv::FILLED);
    cv::imwrite((folder / ("f_" + std::to_string(100000 + frame) + ".png")).string(), picture);
  }
}

std::string manifest(const Job& job) {
  return R"({ "format": "eventgan-manifest", "version": 1, "name": "memory",
    "sources": [{ "dataset": "frames", "root": "clip",
                  "pairs": { "gaps": [1], "side": "before", "choose": "one" } }],
    "image": { "preset": "mpii" }, "output": { "directory": "out", "samples_per_shard": 64 },
    "generator": { "weights": "untrained:)" +
         std::to_string(job.base_width) + "\" } }";
}

/// Runs the program and returns its peak resident memory in MB.
double peak_megabytes(const std::string& manifest_file, int threads) {
  const pid_t child = fork();
  if (child == 0) {
    const int quiet = open("/dev/null", O_WRONLY);
    dup2(quiet, STDOUT_FILENO);
    dup2(quiet, STDERR_FILENO);
    execl(EVENTGAN_PROGRAM, "eventgan", "convert", manifest_file.c_str(), "--threads",
          std::to_string(threads).c_str(), "--overwrite", nullptr);
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  if (wait4(child, &status, 0, &usage) != child || status != 0) {
    throw std::runtime_error("convert failed");
  }
  return double(usage.ru_maxrss) / 1024;
}

double measure(benchmark::State& state, const Job& job) {
  const testing::TemporaryFolder folder;
  write_clip(folder / "clip", job);
  testing::write_file(folder / "manifest.json", manifest(job));
  double peak = 0;
  for (auto _ : state) peak = peak_megabytes((folder / "manifest.json").string(), job.threads);
  state.counters["peak_MB"] = peak;
  state.counters["pairs/s"] =
      benchmark::Counter(job.pairs, benchmark::Counter::kIsIterationInvariantRate);
  return peak;
}

/// 346x260, as a DAVIS346 has.
void BM_PeakMemoryByPairs(benchmark::State& state) {
  const double peak = measure(state, {static_cast<int>(state.range(0)), {346, 260}});
  static const double first_peak = peak;  // of the fewest pairs
  if (peak > 1.15 * first_peak) state.SkipWithError("peak memory grows with the number of pairs");
}
BENCHMARK(BM_PeakMemoryByPairs)
    ->Arg(200)
    ->Arg(2000)
    ->Iterations(1)
    ->UseRealTime()
    ->Unit(benchmark::kSecond);

/// KITTI's size and the published base width.
void BM_PeakMemoryByThreads(benchmark::State& state) {
  const auto threads = static_cast<int>(state.range(0));
  measure(state, {4 * threads, {1242, 375}, 32, threads});
}
BENCHMARK(BM_PeakMemoryByThreads)
    ->Arg(1)
    ->Arg(4)
    ->Iterations(1)
    ->UseRealTime()
    ->Unit(benchmark::kSecond);

}  // namespace
}  // namespace eventgan

BENCHMARK_MAIN();

// Runs a program's benchmarks with memory and threads as pipeline/main.cc sets them up.

#include <benchmark/benchmark.h>

#include <opencv2/core/utility.hpp>

#include "pipeline/runtime/memory.h"

int main(int argc, char** argv) {
  eventgan::keep_big_buffers();
  cv::setNumThreads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

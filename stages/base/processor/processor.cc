#include "stages/base/processor/processor.h"

#include <fstream>

namespace eventgan {

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != line.npos) return line.substr(colon + 2);
  }
  return "unknown processor";
}

#if defined(__x86_64__)

std::string instruction_sets() {
  __builtin_cpu_init();
  std::string sets = "x86-64";
  if (__builtin_cpu_supports("sse4.2")) sets += " sse4.2";
  if (__builtin_cpu_supports("avx2")) sets += " avx2";
  if (__builtin_cpu_supports("fma")) sets += " fma";
  if (__builtin_cpu_supports("avx512f")) sets += " avx512f";
  if (__builtin_cpu_supports("avx512vnni")) sets += " avx512vnni";
  if (__builtin_cpu_supports("avx512bf16")) sets += " avx512bf16";
  return sets;
}

bool has_avx512() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq");
}

bool has_bfloat16() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512bf16");
}

#else

std::string instruction_sets() { return "other"; }

bool has_avx512() { return false; }

bool has_bfloat16() { return false; }

#endif

}  // namespace eventgan

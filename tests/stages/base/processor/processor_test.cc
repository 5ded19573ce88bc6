#include "stages/base/processor/processor.h"

#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <utility>

namespace eventgan {
namespace {

std::set<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  std::set<std::string> found;
  for (std::string word; stream >> word;) found.insert(word);
  return found;
}

/// The instruction sets that Linux has found in the processor.
std::set<std::string> flags() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("flags")) return words(line);
  }
  return {};
}

TEST(Processor, HasTheInstructionSetsThatLinuxFinds) {
  const std::set<std::string> sets = words(instruction_sets());
  if (sets.contains("other")) GTEST_SKIP() << "no x86-64";
  const std::set<std::string> known = flags();
  EXPECT_TRUE(sets.contains("x86-64"));
  for (const auto& [name, flag] :
       std::initializer_list<std::pair<const char*, const char*>>{{"sse4.2", "sse4_2"},
                                                                  {"avx2", "avx2"},
                                                                  {"fma", "fma"},
                                                                  {"avx512f", "avx512f"},
                                                                  {"avx512vnni", "avx512_vnni"},
                                                                  {"avx512bf16", "avx512_bf16"}}) {
    EXPECT_EQ(sets.contains(name), known.contains(flag)) << name;
  }
  EXPECT_EQ(has_avx512(),
            known.contains("avx512bw") && known.contains("avx512vl") && known.contains("avx512dq"));
  EXPECT_EQ(has_bfloat16(), known.contains("avx512_bf16"));
}

TEST(Processor, HasAName) {
  EXPECT_FALSE(processor_name().empty());
  EXPECT_EQ(processor_name().find('\n'), std::string::npos);
}

}  // namespace
}  // namespace eventgan

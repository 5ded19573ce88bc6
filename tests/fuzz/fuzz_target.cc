// One of the readers as a libFuzzer target; EVENTGAN_FUZZ_READER names it. Beside what the
// sanitizers find, an input that makes the reader hold more memory than it may
// (EVENTGAN_FUZZ_MEMORY, a function of the input's size) ends the run.

#include <sanitizer/allocator_interface.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "stages/generator/checkpoints/checkpoint_archive.h"
#include "tests/fuzz/readers.h"

namespace {

std::size_t live_bytes = 0;
std::size_t peak_bytes = 0;

void count_allocation(const volatile void*, std::size_t size) {
  live_bytes += size;
  peak_bytes = std::max(peak_bytes, live_bytes);
}

void count_release(const volatile void* block) {
  if (block == nullptr) return;
  live_bytes -= std::min(live_bytes, __sanitizer_get_allocated_size(block));
}

std::filesystem::path scratch_file() {
  return std::filesystem::temp_directory_path() / ("eventgan-fuzz-" + std::to_string(getpid()));
}

const std::filesystem::path& scratch() {
  static const std::filesystem::path kFile = [] {
    __sanitizer_install_malloc_and_free_hooks(count_allocation, count_release);
    std::atexit([] { std::filesystem::remove(scratch_file()); });
    return scratch_file();
  }();
  return kFile;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path& file = scratch();
  const std::size_t before = live_bytes;
  peak_bytes = before;
  eventgan::testing::EVENTGAN_FUZZ_READER({data, size}, file);
  // The input's own copies: here, in the text, and in the zip file that is made of it.
  const std::size_t copies = 8 * size;
  if (peak_bytes - before > eventgan::EVENTGAN_FUZZ_MEMORY(size) + copies) {
    std::fprintf(stderr, "%zu bytes held for an input of %zu\n", peak_bytes - before, size);
    std::abort();
  }
  return 0;
}

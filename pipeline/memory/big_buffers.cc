#include "pipeline/memory/big_buffers.h"

#include <malloc.h>

namespace eventgan {
namespace {

constexpr int kBig = 1 << 30;  // bytes; larger ones still go back at once

}  // namespace

void keep_big_buffers() {
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, kBig);
  mallopt(M_TRIM_THRESHOLD, kBig);
}

}  // namespace eventgan

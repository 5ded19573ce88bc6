#pragma once

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace eventgan {

/// While it lives, the calling thread's float instructions take subnormal numbers (below 1.2e-38)
/// for zero, as operands and as results. A processor computes them in microcode, up to a hundred
/// times slower; what is that small vanishes in any sum with the activations of an image. On
/// processors without SSE2 nothing changes.
class FlushSubnormals {
 public:
#if defined(__SSE2__)
  FlushSubnormals() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | kFlushToZero | kDenormalsAreZero);
  }
  ~FlushSubnormals() { _mm_setcsr(before_); }

 private:
  static constexpr unsigned kFlushToZero = 0x8000;
  static constexpr unsigned kDenormalsAreZero = 0x0040;
  unsigned before_;

 public:
#else
  FlushSubnormals() {}
#endif
  FlushSubnormals(const FlushSubnormals&) = delete;
  FlushSubnormals& operator=(const FlushSubnormals&) = delete;
};

}  // namespace eventgan

#pragma once

// Eight float32 values as a register of AVX2 holds them. Inlined into functions that are compiled
// for AVX2, and called only where the processor has it.

#if defined(__x86_64__)
#define EVENTGAN_AVX2 __attribute__((target("avx2,fma")))
#else
#define EVENTGAN_AVX2
#endif
#define EVENTGAN_EIGHT_INLINE EVENTGAN_AVX2 __attribute__((always_inline)) inline

namespace eventgan {

inline constexpr int kEight = 8;
using Eight = float __attribute__((vector_size(kEight * sizeof(float)), may_alias));

/// Lanes from and to a multiple of 32 bytes.
EVENTGAN_EIGHT_INLINE Eight eight(const float* values) {
  return *reinterpret_cast<const Eight*>(values);
}
EVENTGAN_EIGHT_INLINE void keep(Eight lanes, float* values) {
  *reinterpret_cast<Eight*>(values) = lanes;
}

/// Eight channels of weights.
struct alignas(32) EightWeights {
  float values[kEight];
};

}  // namespace eventgan

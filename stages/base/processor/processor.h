#pragma once

#include <string>

namespace eventgan {

// What this machine's processor is and can, by itself. What oneDNN takes it for, which
// ONEDNN_MAX_CPU_ISA limits, onednn_support() tells. All thread safe and the same during the whole
// life of a process.

/// Its name as Linux has it, "Intel(R) Xeon(R) Processor", or "unknown processor".
std::string processor_name();

/// Its instruction sets that the numeric libraries choose their kernels by: "x86-64 avx2 fma";
/// "other" where it is no x86-64. Stands in fingerprints.
std::string instruction_sets();

/// Whether it has AVX-512 with instructions for bytes, words and short vectors (BW, DQ, VL).
bool has_avx512();

/// Whether it multiplies bfloat16: every processor with AMX for it has AVX-512's instructions too.
bool has_bfloat16();

}  // namespace eventgan

#include "pipeline/training/precision_advice.h"

namespace eventgan {

std::string precision_advice(TrainingPrecision precision, const std::string& device,
                             const std::string& instructions) {
  // Every processor with AMX for bfloat16 has these too.
  const bool fast = device != "cpu" || instructions.find("avx512bf16") != std::string::npos;
  if (precision == TrainingPrecision::kFloat32 || fast) return "";
  return "precision bfloat16 is slower than float32 on this processor, which has no instructions "
         "for it (" +
         instructions + ")";
}

}  // namespace eventgan

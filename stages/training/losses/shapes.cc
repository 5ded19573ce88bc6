#include <sstream>
#include <stdexcept>

#include "stages/training/losses/shapes_internal.h"

namespace eventgan {

void require_sides(const at::Tensor& tensor, const std::vector<std::int64_t>& sides,
                   const std::string& what) {
  bool fits = tensor.dim() == static_cast<std::int64_t>(sides.size());
  for (std::size_t i = 0; fits && i < sides.size(); ++i) {
    const std::int64_t side = tensor.size(static_cast<std::int64_t>(i));
    fits = sides[i] == -1 ? side > 0 : side == sides[i];
  }
  if (fits) return;
  std::ostringstream message;
  message << "expected shape " << at::IntArrayRef(sides) << ", got " << tensor.sizes() << " ("
          << what << "; -1: any)";
  throw std::invalid_argument(message.str());
}

}  // namespace eventgan

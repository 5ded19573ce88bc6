#include "pipeline/status/fault_kind.h"

#include <algorithm>

namespace eventgan {

std::string fault_kind(const std::string& reason) {
  return reason.substr(0, std::min(reason.find(", in "), reason.find('\n')));
}

}  // namespace eventgan

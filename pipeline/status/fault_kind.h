#pragma once

#include <string>

namespace eventgan {

/// What is wrong with a sample, without where: the reason's first line up to ", in PATH", by which
/// the samples of a damaged disk or a wrong folder fall together.
std::string fault_kind(const std::string& reason);

}  // namespace eventgan

#pragma once

#include <cstdint>
#include <string>

namespace eventgan {

/// The text of the manifest that converts the demo dataset beside it, with comments for a reader
/// who wants to write one of his own.
std::string demo_manifest(std::uint64_t seed);

}  // namespace eventgan

#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace eventgan {

// JSON paths as messages write them: `$` is the document, `$.sources[0].pairs.gaps[2]` a place in
// it.

/// `parent.key`; `parent["odd key"]` where the key is no plain word.
std::string json_path(std::string_view parent, std::string_view key);

/// `parent[index]`.
std::string json_path(std::string_view parent, std::size_t index);

}  // namespace eventgan

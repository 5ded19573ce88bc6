#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace eventgan {

/// Throws std::invalid_argument("expected EXPECTED, got GOT at WHERE"), `got` cut to a readable
/// length.
[[noreturn]] void refuse_json(const std::string& where, const std::string& expected,
                              const nlohmann::ordered_json& got);

}  // namespace eventgan

#pragma once

#include <span>
#include <string_view>

namespace eventgan {

/// The word of `known` that `word` was most likely meant to be: the one fewest edits away, if these
/// are at most a third of its letters (one for short words). Empty if none is so close.
std::string_view near_word(std::string_view word, std::span<const std::string_view> known);

}  // namespace eventgan

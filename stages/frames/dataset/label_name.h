#pragma once

#include <string_view>

namespace eventgan {

/// Whether it may name a class or a joint: not empty, UTF-8, without control characters. (A shard's
/// text ends at a NUL, so that two names could become one; others have no place in a name either.)
bool is_label_name(std::string_view text);

}  // namespace eventgan

#pragma once

#include <string>
#include <string_view>

namespace eventgan {

/// What a sample's files are called, without folder and extension: its sample id, in which '/' is
/// '+' and any byte but A-Z a-z 0-9 _ - @ is %XX (a dot too: some readers cut names at the first
/// one); of what would be longer than 75 bytes the first 58, '~' and 16 hex digits of the id's
/// SHA-256. Different ids have different names. Thread safe.
std::string export_name(std::string_view sample_id);

}  // namespace eventgan

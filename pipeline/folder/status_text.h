#pragma once

#include <string>

#include "pipeline/folder/folder_status.h"

namespace eventgan {

/// What `eventgan status` prints: a few lines of numbers, then who is at work, what dead writers
/// left, what is damaged, and why samples are quarantined; long lists are cut short.
std::string status_text(const FolderStatus& status);

/// The same as JSON, with every entry; null where a number is unknown.
std::string status_json(const FolderStatus& status);

}  // namespace eventgan

#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace eventgan {

/// The version of a format of files that this program writes, as the file says it: "MAJOR.MINOR".
///
/// The rule of all these formats: a later minor version only adds, to what older readers may pass
/// over; anything else is a new major one. So a program reads every minor version of its own major,
/// names what it does not know (and calls that a fault where the minor is not later than its own),
/// and refuses every other major.
struct FormatVersion {
  int major = 1;
  int minor = 0;
  bool operator==(const FormatVersion&) const = default;
};

/// "1.0"
std::string to_string(FormatVersion version);

/// The version that `text` states, if a program that writes `own` reads it: of own's major. None
/// for another major, and for what is no version.
std::optional<FormatVersion> readable_version(std::string_view text, FormatVersion own);

/// What a file should have stated, for "expected X, got Y": "\"1.0\" (this program reads versions
/// 1.x)".
std::string readable_versions(FormatVersion own);

/// A file of a version that this program does not read: nothing says that it is damaged.
class UnreadableVersion : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace eventgan

#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>

namespace eventgan {

/// Name of a file that is being written: ".NAME.HOST.PID.ATTEMPT.tmp", so that everyone can tell
/// whose it is.
struct TemporaryName {
  std::string target;  ///< name of the file it will become
  std::string host;
  pid_t pid = 0;
  unsigned attempt = 0;  ///< counts within the process
  bool operator==(const TemporaryName&) const = default;
};

std::string to_string(const TemporaryName& name);

/// The parts of a temporary file's name that was made on `host`; nothing for any other name.
std::optional<TemporaryName> parse_temporary_name(std::string_view name, std::string_view host);

/// Where a pid means something: this machine's name and the number of the process's pid namespace
/// (containers on one machine may share its name and not its pids).
std::string host_name();

}  // namespace eventgan

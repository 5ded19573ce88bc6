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
  std::string host;    ///< without dots, see host_name
  pid_t pid = 0;
  unsigned attempt = 0;  ///< counts within the process
  bool operator==(const TemporaryName&) const = default;
};

std::string to_string(const TemporaryName& name);

/// The parts of a temporary file's name, made on any host; nothing for any other name.
std::optional<TemporaryName> parse_temporary_name(std::string_view name);

/// Where a pid means something: this machine's name and the number of the process's pid namespace
/// (containers on one machine may share its name and not its pids), without dots: "node7_lab-12".
std::string host_name();

/// `machine` as part of a file name and free of dots: these and slashes become underlines, which no
/// valid machine name has.
std::string without_dots(std::string machine);

}  // namespace eventgan

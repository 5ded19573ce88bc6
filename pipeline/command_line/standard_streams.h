#pragma once

#include <memory>
#include <string>

#include "pipeline/runtime/progress.h"

namespace eventgan {

/// What the program's three standard streams keep to, from the first line of main to its last:
///
/// 1. None is closed: else the next file that is opened, such as a shard, would take its place.
/// 2. With `--progress json` every line on the standard error stream is a JSON object; what is not
///    written as one, by us or a library, becomes {"event": "error", "warning" or "note", "text":
///    ...}. On a terminal a message is in a row of its own, above the bar if there is one, and
///    its first word is coloured if it is "error" or "warning", unless NO_COLOR is set.
/// 3. What could not be written to the standard output is not passed over (finish()).
/// 4. No control character of a name steers a terminal: in a line of the standard output, and in a
///    message, they are escaped (escape_controls). A line without any goes out as it is.
///
/// For one object in the program, made before there are other threads.
class StandardStreams {
 public:
  /// The command line is only searched for --progress json: it may be wrong, and that is reported
  /// too.
  StandardStreams(int argc, const char* const* argv);
  ~StandardStreams();
  StandardStreams(const StandardStreams&) = delete;
  StandardStreams& operator=(const StandardStreams&) = delete;

  /// The exit code of a program that would end with `exit_code`: the same, but kFailed instead of
  /// kComplete, and an error is reported, if the standard output did not take all that was written.
  int finish(int exit_code) const;

 private:
  class JsonLines;
  class PrintableLines;
  std::unique_ptr<PrintableLines> printable_lines_;
  std::unique_ptr<JsonLines> json_lines_;  ///< null: lines are for people
};

/// A message on the standard error stream: "error: TEXT", "warning: TEXT", "note: TEXT", or TEXT
/// alone, and a line end; with `--progress json` one JSON line, however many lines the text has.
/// Thread safe: a line of one thread stays whole.
void tell_error(const std::string& text);
void tell_warning(const std::string& text);
void tell_note(const std::string& text);
void tell(const std::string& text);

/// What a StopSignal tells at Ctrl-C, as tell() would write it: what is done before the end, and
/// what another Ctrl-C does.
std::string stopping_line(const std::string& what);

/// How wide the terminal on the standard error stream is, asked again at each call; none where that
/// stream is no terminal, or one that cannot redraw a line (TERM unset or "dumb").
ProgressDisplay::Columns terminal_columns();

}  // namespace eventgan

#include "pipeline/command_line/standard_streams.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <streambuf>
#include <string_view>
#include <utility>

#include "manifests/documents/json_text.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {
namespace {

/// A closed one becomes /dev/null, in ascending order since an opened file takes the lowest free
/// number; the output for reading only, so that writing to it still fails.
void open_closed_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) != -1) continue;
    if (open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY) != stream) return;
  }
}

bool asks_for_json(int argc, const char* const* argv) {
  using namespace std::string_view_literals;
  for (int i = 1; i < argc; ++i) {
    if (argv[i] == "--progress=json"sv) return true;
    if (argv[i] == "--progress"sv && i + 1 < argc && argv[i + 1] == "json"sv) return true;
  }
  return false;
}

std::string json_line(const std::string& line) {
  if (line.starts_with('{') && nlohmann::json::accept(line)) return line;
  for (const std::string event : {"error", "warning", "note"}) {
    const std::string start = event + ": ";
    if (line.starts_with(start)) return message_json(event, line.substr(start.size()));
  }
  return message_json("note", line);
}

/// Whether the standard error stream is for machines; set before there are other threads.
bool is_json = false;

/// Whether it is a terminal that knows control sequences, and whether these may be colours.
bool can_redraw = false;
bool has_colours = false;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

void look_at_terminal() {
  const std::string term = variable("TERM");
  can_redraw = isatty(STDERR_FILENO) != 0 && !term.empty() && term != "dumb";
  has_colours = can_redraw && variable("NO_COLOR").empty();
}

/// Whether a line has characters that steer a terminal: U+0000..1F but tabs, and 7F..9F.
bool has_controls(std::string_view line) {
  unsigned char before = 0;
  return std::ranges::any_of(line, [&](char c) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_upper = std::exchange(before, byte) == 0xc2 && byte >= 0x80 && byte < 0xa0;
    return (byte < 0x20 && byte != '\t') || byte == 0x7f || is_upper;
  });
}

/// The lines with control characters escaped where there are any: names of files, classes and
/// samples may hold them.
std::string without_controls(std::string_view lines) {
  std::string shown;
  while (true) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    const std::string_view line = lines.substr(0, end);
    shown += has_controls(line) ? escape_controls(line) : std::string(line);
    if (end == lines.size()) return shown;
    shown += '\n';
    lines.remove_prefix(end + 1);
  }
}

std::string line_of(const std::string& event, const std::string& start, const std::string& text) {
  if (is_json) return message_json(event, text) + "\n";
  return (can_redraw ? kWipeRow : "") + start + without_controls(text) + "\n";
}

/// In one piece: a bar may be drawn by another thread meanwhile.
void tell(const std::string& event, const std::string& start, const std::string& text) {
  std::cerr << line_of(event, start, text) << std::flush;
}

/// `start` in a colour of ECMA-48's SGR sequences: "31" red, "33" yellow; "1;" bold.
std::string coloured(const std::string& start, const std::string& colour) {
  return has_colours ? "\x1b[" + colour + "m" + start + "\x1b[0m" : start;
}

}  // namespace

/// Stands in std::cerr's place before the buffer that was there. A line of one thread stays whole.
class StandardStreams::JsonLines final : public std::streambuf {
 public:
  JsonLines() : target_(std::cerr.rdbuf(this)) {}

  ~JsonLines() override {
    if (!line_.empty()) overflow('\n');
    std::cerr.rdbuf(target_);
  }
  JsonLines(const JsonLines&) = delete;
  JsonLines& operator=(const JsonLines&) = delete;

 protected:
  int_type overflow(int_type character) override {
    if (character == traits_type::eof()) return traits_type::not_eof(character);
    if (character != '\n') {
      line_ += traits_type::to_char_type(character);
    } else if (!line_.empty()) {
      const std::string text = json_line(line_) + "\n";
      line_.clear();
      target_->sputn(text.data(), static_cast<std::streamsize>(text.size()));
      target_->pubsync();
    }
    return character;
  }

 private:
  static thread_local std::string line_;  ///< what a thread has written of a line so far
  std::streambuf* target_;
};

thread_local std::string StandardStreams::JsonLines::line_;

/// Stands in std::cout's place before the buffer that was there.
class StandardStreams::PrintableLines final : public std::streambuf {
 public:
  PrintableLines() : target_(std::cout.rdbuf(this)) {}

  ~PrintableLines() override {
    PrintableLines::sync();
    std::cout.rdbuf(target_);
  }
  PrintableLines(const PrintableLines&) = delete;
  PrintableLines& operator=(const PrintableLines&) = delete;

 protected:
  int_type overflow(int_type character) override {
    if (character == traits_type::eof()) return traits_type::not_eof(character);
    line_ += traits_type::to_char_type(character);
    return character != '\n' || pass_on() ? character : traits_type::eof();
  }

  int sync() override { return pass_on() ? target_->pubsync() : -1; }

 private:
  bool pass_on() {
    const std::string text = without_controls(line_);
    line_.clear();
    const auto size = static_cast<std::streamsize>(text.size());
    return target_->sputn(text.data(), size) == size;
  }

  std::string line_;  ///< what has been written of a line so far
  std::streambuf* target_;
};

StandardStreams::StandardStreams(int argc, const char* const* argv) {
  open_closed_streams();
  is_json = asks_for_json(argc, argv);
  look_at_terminal();
  printable_lines_ = std::make_unique<PrintableLines>();
  if (is_json) json_lines_ = std::make_unique<JsonLines>();
}

StandardStreams::~StandardStreams() = default;

int StandardStreams::finish(int exit_code) const {
  std::cout.flush();
  if (std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return exit_code;
  tell_error("expected a writable standard output, got one that is closed or on a full disk");
  return exit_code == kComplete ? static_cast<int>(kFailed) : exit_code;
}

void tell_error(const std::string& text) { tell("error", coloured("error: ", "1;31"), text); }

void tell_warning(const std::string& text) { tell("warning", coloured("warning: ", "1;33"), text); }

void tell_note(const std::string& text) { tell("note", "note: ", text); }

void tell(const std::string& text) { tell("note", "", text); }

std::string stopping_line(const std::string& what) {
  return line_of("note", "", "stopping: " + what + "; press Ctrl-C again to quit immediately");
}

ProgressDisplay::Columns terminal_columns() {
  if (!can_redraw) return {};
  return [] {
    constexpr int kUnknown = 80;
    winsize size{};
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUnknown;
  };
}

}  // namespace eventgan

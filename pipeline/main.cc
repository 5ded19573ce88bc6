#include <sys/auxv.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <string>
#include <string_view>
#include <system_error>

#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"
#include "pipeline/commands/commands.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/memory.h"

namespace {

/// Becomes the other program: beside this one where it is built, in libexec where it is installed.
/// Returns, and tells why, only if it cannot.
void become(const eventgan::HandOver& other, char** argv) {
  namespace fs = std::filesystem;
  std::error_code fault;
  fs::path self = fs::read_symlink("/proc/self/exe", fault);
  if (fault) {  // no /proc
    // NOLINTNEXTLINE(performance-no-int-to-ptr): the kernel has no other way to tell it
    self = fs::canonical(reinterpret_cast<const char*>(getauxval(AT_EXECFN)), fault);
  }
  // One that hands over to itself, as a copy of this program under the other's name would, for
  // ever.
  constexpr const char* kBecome = "EVENTGAN_BECOME";
  const char* before = std::getenv(kBecome);
  if (fault || (before != nullptr && std::string_view(before) == other.program)) {
    eventgan::tell_error(std::string("expected ") + other.program + ", got " +
                         (fault ? "no place where to look for it"
                                : "another program of its name, " + self.string()) +
                         ": " + other.advice);
    return;
  }
  setenv(kBecome, other.program, 1);
  const fs::path folder = self.parent_path();
  const fs::path installed = (folder / EVENTGAN_LIBEXEC_FROM_PROGRAM).lexically_normal();
  for (const fs::path& program : {folder / other.program, installed / other.program}) {
    execv(program.c_str(), argv);
    if (errno == ENOENT) continue;
    eventgan::tell_error("expected to run " + program.string() + ", got '" + std::strerror(errno) +
                         "'");
    return;
  }
  eventgan::tell_error(std::string("expected ") + other.program + ", got none in " +
                       installed.string() + ": " + other.advice);
}

}  // namespace

int main(int argc, char** argv) {
  const eventgan::StandardStreams streams(argc, argv);
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond ulimit -f fails then, as any other may
  std::signal(SIGCHLD, SIG_DFL);  // ignored, as a caller may leave it, children would tell no end
  eventgan::keep_big_buffers();
  cv::setNumThreads(1);  // the flow graph is the only source of parallelism

  CLI::App app(
      "Turn labelled image datasets into event-camera training data\nReads KITTI, MPII, Human3.6M, "
      "your own images and videos with their labels, and recordings of event cameras.");
  app.name("eventgan");
  eventgan::wrap_help(app);
  app.set_version_flag("--version", eventgan::version_text);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 complete; 1 failed; 64 bad command line or manifest;\n65 too many quarantined "
      "samples; 66 input missing; 75 stopped: run it again");

  int exit_code = eventgan::kFailed;
  eventgan::add_init_command(app, exit_code);
  eventgan::add_outline_command(app, exit_code);
  eventgan::add_convert_command(app, exit_code);
  eventgan::add_plan_command(app, exit_code);
  eventgan::add_status_command(app, exit_code);
  eventgan::add_retry_command(app, exit_code);
  eventgan::add_finalize_command(app, exit_code);
  eventgan::add_verify_command(app, exit_code);
  eventgan::add_inspect_command(app, exit_code);
  eventgan::add_preview_command(app, exit_code);
  eventgan::add_report_command(app, exit_code);
  eventgan::add_export_command(app, exit_code);
  eventgan::add_make_demo_command(app, exit_code);
  eventgan::add_import_weights_command(app, exit_code);
  eventgan::add_calibrate_command(app, exit_code);
  eventgan::add_realism_command(app, exit_code);
  eventgan::add_fit_command(app, exit_code);
  eventgan::add_simulate_command(app, exit_code);
  eventgan::add_train_command(app, exit_code);
  eventgan::add_tradeoff_command(app, exit_code);
  eventgan::add_help_command(app, exit_code);
  eventgan::refuse_empty_values(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool asked_for = error.get_exit_code() == 0;  // --help, --version
    exit_code = asked_for ? eventgan::kComplete : eventgan::kUsage;
    if (asked_for) {
      app.exit(error);
    } else {
      eventgan::tell_error(eventgan::usage_text(app, error));
    }
  } catch (const std::exception& error) {
    exit_code = eventgan::exit_code_of(error);
    // One fault is reported in one line, however many layers have something to say of it; a list of
    // faults in a line each.
    const bool is_list = std::string_view(error.what()).find('\n') != std::string_view::npos;
    eventgan::tell_error(is_list ? eventgan::error_text(error) : eventgan::error_line(error));
  } catch (const eventgan::HandOver& other) {
    become(other, argv);
  }
  return streams.finish(exit_code);
}

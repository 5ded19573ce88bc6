#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>

#include "pipeline/commands/commands.h"
#include "pipeline/errors/error_text.h"
#include "pipeline/errors/exit_codes.h"
#include "pipeline/memory/big_buffers.h"
#include "pipeline/planning/fingerprint.h"

int main(int argc, char** argv) {
  eventgan::keep_big_buffers();
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);  // quiet
  cv::setNumThreads(1);  // the flow graph is the only source of parallelism
  // Decoding errors are reported by us, with the sample they belong to.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);

  CLI::App app(
      "Turns labelled frame datasets (KITTI, MPII, Human3.6M) into event-camera training data");
  app.name("eventgan");
  app.set_version_flag("--version", eventgan::program_version());
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 complete; 1 failed; 64 usage or bad manifest; 65 too many bad samples; 66 "
      "input missing; 75 stopped, run again.");

  int exit_code = eventgan::kFailed;
  eventgan::add_convert_command(app, exit_code);
  eventgan::add_plan_command(app, exit_code);
  eventgan::add_status_command(app, exit_code);
  eventgan::add_retry_command(app, exit_code);
  eventgan::add_finalize_command(app, exit_code);
  eventgan::add_verify_command(app, exit_code);
  eventgan::add_inspect_command(app, exit_code);
  eventgan::add_preview_command(app, exit_code);
  eventgan::add_make_demo_command(app, exit_code);
  eventgan::add_import_weights_command(app, exit_code);
  eventgan::add_calibrate_command(app, exit_code);
  eventgan::add_realism_command(app, exit_code);
  eventgan::add_simulate_command(app, exit_code);
  eventgan::add_train_command(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? eventgan::kComplete : eventgan::kUsage;
  } catch (const std::exception& error) {
    std::cerr << "error: " << eventgan::error_text(error) << std::endl;
    return eventgan::exit_code_of(error);
  }
  return exit_code;
}

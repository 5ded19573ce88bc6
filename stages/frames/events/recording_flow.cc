#include "stages/frames/events/recording_flow.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// From and to must lie behind each other, as maps follow one another.
void check_times(const std::vector<std::array<double, 2>>& times_s, const std::string& place) {
  double before_s = -HUGE_VAL;
  for (const auto& [from_s, to_s] : times_s) {
    if (std::isfinite(from_s) && std::isfinite(to_s) && before_s < from_s && from_s < to_s) {
      before_s = from_s;
      continue;
    }
    throw InputError(
        fmt::format("expected flow from ascending times, each to a later one, got {} s "
                    "to {} s after {} s, in {}",
                    from_s, to_s, before_s, place));
  }
}

/// Lines of two times in µs, and comments.
std::vector<std::array<double, 2>> read_times(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text) {
    throw InputError(
        fmt::format("expected the times of DSEC's flow, got no readable file ({}), in {}", reason,
                    file.string()));
  }
  std::vector<std::array<double, 2>> times_s;
  std::istringstream stream(*text);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    line.erase(line.find_last_not_of(" \r") + 1);
    if (line.empty() || line.starts_with('#')) continue;
    constexpr std::int64_t kLatest_us = std::int64_t{1} << 53;
    std::array<std::int64_t, 2> span_us{};
    const char* const end = line.data() + line.size();
    const auto from = std::from_chars(line.data(), end, span_us[0]);
    const char* second = from.ptr;
    while (second != end && (*second == ' ' || *second == ',')) ++second;
    const auto to = std::from_chars(second, end, span_us[1]);
    const auto is_time = [](std::int64_t us) { return us > -kLatest_us && us < kLatest_us; };
    if (from.ec != std::errc() || to.ec != std::errc() || to.ptr != end || !is_time(span_us[0]) ||
        !is_time(span_us[1])) {
      throw InputError(
          fmt::format("expected two times in whole us, got another line, in {} (line {})",
                      file.string(), number));
    }
    times_s.push_back(
        {static_cast<double>(span_us[0]) / 1e6, static_cast<double>(span_us[1]) / 1e6});
  }
  check_times(times_s, file.string());
  return times_s;
}

std::optional<RecordingFlow> open_dsec_flow(const fs::path& events_file,
                                            const RecordingOptions& options) {
  const fs::path side = events_file.parent_path();
  const fs::path flow = side.parent_path().parent_path() / "flow";
  if (!has_folder(flow)) return std::nullopt;
  if (options.camera != "left") {
    throw InputError("expected the left camera, which DSEC's flow is of, got \"camera\": \"" +
                     options.camera + "\", in " + flow.string());
  }
  if (!options.rectify && has_file(side / "rectify_map.h5")) {
    throw InputError(
        "expected \"rectify\": true, since DSEC's flow is of the rectified view, got "
        "false, in " +
        flow.string());
  }
  const fs::path folder = flow / "forward", times = flow / "forward_timestamps.txt";
  RecordingFlow found{read_times(times), nullptr, {times}};
  std::vector<fs::path> images;
  for (const std::string& name : list_folder(folder).files) {
    if (fs::path(name).extension() == ".png") images.push_back(folder / name);
  }
  if (images.size() != found.times_s.size() || images.empty()) {
    throw InputError(fmt::format("expected an image for each of {} times, got {}, in {}",
                                 found.times_s.size(), images.size(), folder.string()));
  }
  found.files.insert(found.files.end(), images.begin(), images.end());
  found.read = [images = std::move(images)](std::size_t i) {
    try {
      return read_flow_image(images.at(i), kDsecFlowSteps);
    } catch (const std::runtime_error& error) {
      throw InputError(fmt::format("{}, in {}", error.what(), images.at(i).string()));
    }
  };
  return found;
}

/// Where the field is finite and not 0, it is known.
SourceFlow flow_of(ImageSize size, std::vector<float> x_px, const std::vector<float>& y_px) {
  SourceFlow flow{size, {std::move(x_px), std::vector<std::uint8_t>(size.pixel_count())}};
  std::vector<float>& px = flow.flow.px;
  px.insert(px.end(), y_px.begin(), y_px.end());
  const std::size_t pixels = size.pixel_count();
  for (std::size_t i = 0; i < pixels; ++i) {
    float &x = px[i], &y = px[pixels + i];
    const bool is_known = std::isfinite(x) && std::isfinite(y);
    flow.flow.valid[i] = is_known;
    if (!is_known) x = y = 0;
  }
  return flow;
}

/// Of `simulate`, each pixel of which is known.
std::optional<RecordingFlow> simulated_flow(const Recording& recording) {
  if (recording.frame_count() < 2 || !recording.flow(0)) return std::nullopt;
  RecordingFlow found;
  for (std::int64_t i = 0; i + 1 < recording.frame_count(); ++i) {
    found.times_s.push_back({recording.frame_time_s(i), recording.frame_time_s(i + 1)});
  }
  found.read = [&recording](std::size_t i) {
    FlowField field = *recording.flow(static_cast<std::int64_t>(i));
    return flow_of(field.size, std::move(field.x_px), field.y_px);
  };
  return found;
}

}  // namespace

std::optional<RecordingFlow> open_recording_flow(const Recording& recording, RecordingFormat format,
                                                 const fs::path& events_file,
                                                 const RecordingOptions& options) {
  if (format == RecordingFormat::kDsec) return open_dsec_flow(events_file, options);
  if (format == RecordingFormat::kMvsec) return simulated_flow(recording);
  return std::nullopt;
}

}  // namespace eventgan

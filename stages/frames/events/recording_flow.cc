#include "stages/frames/events/recording_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/archives/npz_array.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/frames/decoding/source_flow.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

std::string mvsec_flow_name(const std::filesystem::path& events_file) {
  std::string name = events_file.stem().string();
  constexpr std::string_view kData = "_data";
  if (name.ends_with(kData)) name.resize(name.size() - kData.size());
  return name + "_gt_flow_dist.npz";
}

namespace {

namespace fs = std::filesystem;

void check_times(const std::vector<Span>& times_s, const std::string& place) {
  const Span* before = nullptr;
  for (const Span& span : times_s) {
    const auto [from_s, to_s] = span;
    if (!(std::isfinite(from_s) && std::isfinite(to_s) && from_s < to_s)) {
      throw InputError(fmt::format("expected flow to a later time, got {} s to {} s, in {}", from_s,
                                   to_s, place));
    }
    if (before && from_s <= (*before)[0]) {
      throw InputError(fmt::format("expected flow at ascending times, got {} s after {} s, in {}",
                                   from_s, (*before)[0], place));
    }
    before = &span;
  }
}

void require_left(const std::string& camera, const char* dataset, const fs::path& place) {
  if (camera == "left") return;
  throw InputError(
      fmt::format("expected the left camera, which {}'s flow is of, got \"camera\": \"{}\", in {}",
                  dataset, camera, place.string()));
}

/// Lines of two times in µs, and comments.
std::vector<Span> read_times(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text) {
    throw InputError(
        fmt::format("expected the times of DSEC's flow, got no readable file ({}), in {}", reason,
                    file.string()));
  }
  std::vector<Span> times_s;
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

std::optional<RecordingFlow> open_dsec_flow(const fs::path& events_file, ImageSize sensor,
                                            const RecordingOptions& options) {
  const fs::path side = events_file.parent_path();  // SEQUENCE/events/left
  if (side.parent_path().filename() != "events") return std::nullopt;
  const fs::path flow = side.parent_path().parent_path() / "flow";
  const fs::path folder = flow / "forward", times = flow / "forward_timestamps.txt";
  if (!has_folder(folder) && !has_file(times)) {
    if (!has_folder(flow / "backward")) return std::nullopt;
    throw InputError(
        "expected flow/forward, got flow/backward alone, which \"side\": \"before\" makes, in " +
        flow.parent_path().string());
  }
  require_left(side.filename() == "left" ? options.camera : side.filename().string(), "DSEC", flow);
  const fs::path map = side / "rectify_map.h5";
  if (!options.rectify && has_file(map) && moves_events(map, sensor)) {
    throw InputError(
        "expected \"rectify\": true, since DSEC's flow is of the rectified view, got "
        "false, in " +
        flow.string());
  }
  RecordingFlow found{read_times(times), nullptr, {times}};
  found.is_of_unknown_view = !options.rectify && !has_file(map);
  std::vector<fs::path> images;
  for (const std::string& name : list_folder(folder).files) {
    if (fs::path(name).extension() == ".png") images.push_back(folder / name);
  }
  std::ranges::sort(images, {}, [](const fs::path& image) {  // by number, with zeros or without
    return std::pair(image.filename().string().size(), image);
  });
  if (images.size() != found.times_s.size() || images.empty()) {
    throw InputError(fmt::format("expected an image for each of {} times, got {}, in {}",
                                 found.times_s.size(), images.size(), folder.string()));
  }
  found.files.insert(found.files.end(), images.begin(), images.end());
  found.read = [images = std::move(images)](std::size_t i) {
    try {
      return read_flow_image(images.at(i), images.at(i).string(), kDsecFlowSteps);
    } catch (const std::runtime_error& error) {
      throw InputError(error.what());
    }
  };
  return found;
}

/// The arrays of NAME_gt_flow_dist.npz, which are larger than memory.
class MvsecFlow {
 public:
  MvsecFlow(fs::path file, ImageSize size)
      : file_(std::move(file)), size_(size), x_(file_, "x_flow_dist"), y_(file_, "y_flow_dist") {}

  std::vector<Span> times_s() const {
    const TypedArray times = parse_npy(ZipArchive(file_).read("timestamps.npy"), file_.string());
    const std::vector<std::size_t> shape{times.size(), static_cast<std::size_t>(size_.height),
                                         static_cast<std::size_t>(size_.width)};
    const bool are_fields = x_.shape() == shape && y_.shape() == shape;
    if (times.shape.size() != 1 || times.is_text() || !are_fields) {
      throw InputError(fmt::format(
          "expected timestamps [N], x_flow_dist and y_flow_dist [N, {}, {}], got {}, [{}] and "
          "[{}], in {}",
          size_.height, size_.width, times.shape_text(), fmt::join(x_.shape(), ", "),
          fmt::join(y_.shape(), ", "), file_.string()));
    }
    std::vector<Span> times_s;
    for (std::size_t i = 1; i < times.size(); ++i) {
      times_s.push_back({times.number(i - 1), times.number(i)});
    }
    check_times(times_s, file_.string());
    return times_s;
  }

  /// Of pixels whose depth is not known, x and y are 0, infinite, or no number.
  SourceFlow read(std::size_t index) const try {
    std::vector<float> px = values(x_, index);
    const std::vector<float> y_px = values(y_, index);
    const std::size_t pixels = px.size();
    px.insert(px.end(), y_px.begin(), y_px.end());
    SourceFlow flow{file_.string(), size_, {std::move(px), std::vector<std::uint8_t>(pixels)}};
    for (std::size_t i = 0; i < pixels; ++i) {
      float &x = flow.flow.px[i], &y = flow.flow.px[pixels + i];
      const bool is_known = std::isfinite(x) && std::isfinite(y) && (x != 0 || y != 0);
      flow.flow.valid[i] = is_known;
      if (!is_known) x = y = 0;
    }
    return flow;
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }

 private:
  std::vector<float> values(const NpzArray& array, std::size_t index) const {
    const TypedArray slice = array.slice(index);
    if (slice.is_text()) throw InputError("expected numbers, got text, in " + file_.string());
    std::vector<float> values(slice.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(slice.number(i));
    }
    return values;
  }

  fs::path file_;
  ImageSize size_;
  NpzArray x_, y_;
};

std::optional<RecordingFlow> open_mvsec_flow(const fs::path& events_file, ImageSize size,
                                             const RecordingOptions& options) {
  const fs::path file = events_file.parent_path() / mvsec_flow_name(events_file);
  if (!has_file(file)) return std::nullopt;
  require_left(options.camera, "MVSEC", file);
  try {
    const auto flow = std::make_shared<const MvsecFlow>(file, size);
    return RecordingFlow{
        flow->times_s(), [flow](std::size_t index) { return flow->read(index); }, {file}};
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }
}

}  // namespace

std::optional<std::size_t> RecordingFlow::map_from(double time_s, double tolerance_s) const {
  const auto map = std::ranges::lower_bound(times_s, time_s - tolerance_s, {},
                                            [](const Span& span) { return span[0]; });
  if (map == times_s.end() || (*map)[0] > time_s + tolerance_s) return std::nullopt;
  return static_cast<std::size_t>(map - times_s.begin());
}

std::optional<RecordingFlow> open_recording_flow(RecordingFormat format,
                                                 const fs::path& events_file, ImageSize size,
                                                 const RecordingOptions& options) {
  if (format == RecordingFormat::kDsec) return open_dsec_flow(events_file, size, options);
  if (format == RecordingFormat::kMvsec) return open_mvsec_flow(events_file, size, options);
  return std::nullopt;
}

}  // namespace eventgan

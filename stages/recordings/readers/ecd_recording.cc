#include "stages/recordings/readers/detail/ecd_recording.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/recordings/readers/detail/frame_intervals.h"
#include "stages/recordings/readers/detail/recording_reader.h"

namespace eventgan {
namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr char kEvents[] = "events.txt";

std::filesystem::path event_file_of(const std::filesystem::path& path, const RecordingOptions&) {
  std::error_code ignored;
  return std::filesystem::exists(path / kEvents, ignored) ? path / kEvents : path;
}

/// A recording is one folder: what its list names lies in it.
bool leaves_folder(const std::filesystem::path& path) {
  if (path.is_absolute()) return true;
  for (const auto& part : path) {
    if (part == "..") return true;
  }
  return false;
}

/// False if the line is none.
bool add_line(std::string_view line, EcdImageList& list) {
  double time_s = 0;
  const auto [stop, error] = std::from_chars(line.data(), line.data() + line.size(), time_s);
  const std::string_view rest(stop, static_cast<std::size_t>(line.data() + line.size() - stop));
  const std::string_view path = trimmed(rest);
  if (error != std::errc() || path.empty() || kBlanks.find(rest.front()) == kBlanks.npos ||
      leaves_folder(path)) {
    return false;
  }
  list.times_s.push_back(time_s);
  list.paths.emplace_back(path);
  return true;
}

}  // namespace

EcdImageList read_ecd_image_list(const std::filesystem::path& file) {
  std::string reason;
  const auto text_of_file = try_read_file(file, reason);
  if (!text_of_file) {
    throw InputError("expected a list of frames, got no readable file (" + reason + "), in " +
                     file.string());
  }
  std::istringstream stream(*text_of_file);
  EcdImageList list;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::string_view text = trimmed(line);
    if (text.empty() && stream.peek() == std::istringstream::traits_type::eof()) break;
    if (!add_line(text, list)) {
      throw InputError(
          "expected a time in seconds and a path inside the folder, got another line, in " +
          file.string() + " (line " + std::to_string(number) + ")");
    }
  }
  check_frame_times(list.times_s, file.string());
  return list;
}

namespace {

/// Frames are looked for when a recording is opened, not hours later.
EcdImageList list_of_present_images(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    throw InputError("expected a folder with images.txt and events.txt, got none, in " +
                     folder.string());
  }
  EcdImageList images = read_ecd_image_list(folder / "images.txt");
  for (std::size_t i = 0; i < images.paths.size(); ++i) {
    const std::filesystem::path image = folder / images.paths[i];
    if (std::filesystem::is_regular_file(image, ignored)) continue;
    throw InputError("expected an image, got none, in " + image.string() + " (frame " +
                     std::to_string(i) + ")");
  }
  return images;
}

std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder,
                                            const EcdImageList& images) {
  std::vector<std::filesystem::path> files;
  for (const std::string& path : images.paths) files.push_back(folder / path);
  return files;
}

}  // namespace

EcdRecording::EcdRecording(const std::filesystem::path& folder)
    : EcdRecording(folder, list_of_present_images(folder)) {}

EcdRecording::EcdRecording(const std::filesystem::path& folder, const EcdImageList& images)
    : name_(folder.string()),
      events_(folder / kEvents),
      frames_(files_of(folder, images), images.times_s) {}

double EcdRecording::frame_time_s(std::int64_t index) const {
  return frames_.times_s()[frame_position(index, frame_count(), name_)];
}

GreyImage EcdRecording::frame(std::int64_t index) const {
  frame_position(index, frame_count(), name_);
  return frames_.read(index);
}

std::vector<Event> EcdRecording::events_between(std::int64_t first_frame,
                                                std::int64_t last_frame) const {
  const auto [first, last] = frame_range(first_frame, last_frame, frame_count(), name_);
  if (first == last) return {};
  return events_in(frames_.times_s()[first], frames_.times_s()[last]);
}

std::vector<Event> EcdRecording::events_in(double after_s, double until_s) const {
  events_.require_order(after_s, until_s);
  return events_.events(events_.first_byte_after(after_s), events_.first_byte_after(until_s),
                        EventCheck(size(), after_s, until_s));
}

std::vector<Event> EcdRecording::events_around(double time_s, std::int64_t before,
                                               std::int64_t after) const {
  events_.require_order(time_s, time_s);
  const std::int64_t middle = events_.first_byte_after(time_s);
  const std::int64_t begin = events_.skip_lines(middle, -before);
  const std::int64_t end = events_.skip_lines(middle, after);
  if (begin < end) {  // events of these times may lie elsewhere
    events_.require_order(std::min(events_.time_at(begin), time_s),
                          std::max(events_.time_at(events_.skip_lines(end, -1)), time_s));
  }
  return events_.events(begin, end, EventCheck::of_any_time(size()));
}

std::optional<FlowField> EcdRecording::flow(std::int64_t index) const {
  frame_position(index, frame_count() - 1, name_);
  return std::nullopt;
}

constinit const RecordingReader kEcdReader{
    .format = RecordingFormat::kEcd,
    .fits =
        [](const RecordingInput& input, const RecordingOptions& options) {
          return event_file_of(input.path(), options).filename() == kEvents;
        },
    .open = [](const std::filesystem::path& path,
               const RecordingOptions&) -> std::unique_ptr<Recording> {
      return std::make_unique<EcdRecording>(path.filename() == kEvents ? path.parent_path() : path);
    },
    .event_file = event_file_of,
    .companions =
        [](const std::filesystem::path& event_file, const RecordingOptions&) {
          return std::vector{event_file.parent_path() / "images.txt"};
        }};

}  // namespace eventgan

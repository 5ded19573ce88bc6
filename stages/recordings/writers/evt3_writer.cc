#include "stages/recordings/writers/evt3_writer.h"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

constexpr std::size_t kBytesAtOnce = 1 << 16;
constexpr int kLowBits = 12;
constexpr std::string_view kSettings = "% simulation ";
enum WordType : unsigned { kRow = 0x0, kColumn = 0x2, kTimeLow = 0x6, kTimeHigh = 0x8 };

}  // namespace

Evt3Writer::Evt3Writer(const std::filesystem::path& file, ImageSize size,
                       const std::string& settings)
    : file_(file), size_(size) {
  if (size.height < 1 || size.width < 1 || size.height > kLargestSide ||
      size.width > kLargestSide) {
    throw std::invalid_argument("expected a sensor of 1 to 2048 pixels a side for EVT 3.0, got " +
                                to_string(size));
  }
  file_.create();
  // Without the names of Prophesee's plugin its programs look for a camera's own.
  words_ = fmt::format(
      "% camera_integrator_name Prophesee\n"
      "% evt 3.0\n"
      "% format EVT3;height={0};width={1}\n"
      "% geometry {1}x{0}\n"
      "% plugin_integrator_name Prophesee\n"
      "% plugin_name hal_plugin_prophesee\n"
      "{2}{3}{4}"
      "% end\n",
      size.height, size.width, settings.empty() ? "" : kSettings, settings,
      settings.empty() ? "" : "\n");
}

void Evt3Writer::add_events(std::span<const StampedEvent> events) {
  require_recordable(events, size_, last_us_);
  for (const StampedEvent& event : events) {
    go_to(event.t_us);
    if (y_ != event.y) put(kRow, y_.emplace(event.y));
    put(kColumn, event.x | (event.positive ? 1 << 11 : 0));
  }
}

void Evt3Writer::commit(std::int64_t end_us, const std::function<void()>& before_publishing) {
  if (end_us < last_us_) {
    throw std::invalid_argument("expected an end that is not before the last event");
  }
  go_to(end_us);
  write_if_full(0);
  file_.sync();
  if (before_publishing) before_publishing();
  file_.publish();
}

std::optional<std::string> evt3_settings(const std::filesystem::path& path) {
  const InputFile file(path);
  const std::string start = file.read(0, std::min<std::uint64_t>(file.size_bytes(), kBytesAtOnce));
  for (std::size_t at = 0; at < start.size() && start[at] == '%';) {
    const std::size_t end = std::min(start.find('\n', at), start.size());
    const std::string_view line = std::string_view(start).substr(at, end - at);
    if (line.starts_with(kSettings)) return std::string(line.substr(kSettings.size()));
    at = end + 1;
  }
  return std::nullopt;
}

void Evt3Writer::go_to(std::int64_t t_us) {
  last_us_ = t_us;
  while (high_ < t_us >> kLowBits) {
    put(kTimeHigh, ++high_ & 0xfff);
    low_.reset();
  }
  if (const std::int64_t low = t_us & 0xfff; low_ != low) put(kTimeLow, low_.emplace(low));
}

void Evt3Writer::put(unsigned type, std::int64_t value) {
  const auto word = type << 12 | static_cast<unsigned>(value);
  words_.push_back(static_cast<char>(word & 0xff));
  words_.push_back(static_cast<char>(word >> 8));
  write_if_full(kBytesAtOnce);
}

void Evt3Writer::write_if_full(std::size_t most) {
  if (words_.size() <= most) return;
  file_.write(words_);
  words_.clear();
}

}  // namespace eventgan

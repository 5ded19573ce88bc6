#include "stages/frames/sequences/video_labels.h"

#include <charconv>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/files/text_file.h"

namespace eventgan {

std::optional<VideoLabels> read_video_labels(const std::filesystem::path& file,
                                             const std::string& video) {
  const auto refuse = [&](const std::string& expected, const std::string& got) {
    throw InputError("expected " + expected + ", got " + got + ", in " + file.string() +
                     " (taken as the labels of " + video + ")");
  };
  nlohmann::ordered_json labels;
  try {
    labels =
        parse_json_data(read_text_file(file), file.filename().string(), JsonComments::kPassedOver);
  } catch (const std::runtime_error& error) {
    refuse("a JSON object from frame number to label", "\"" + std::string(error.what()) + "\"");
  }
  if (!labels.is_object()) refuse("a JSON object from frame number to label", labels.type_name());
  if (const auto format = labels.find("format");
      format != labels.end() && *format == "eventgan-manifest") {
    return std::nullopt;
  }

  VideoLabels by_frame;
  for (const auto& [key, label] : labels.items()) {
    std::int64_t frame = -1;
    const char* const end = key.data() + key.size();
    const auto [stop, error] = std::from_chars(key.data(), end, frame);
    if (error != std::errc() || stop != end || frame < 0)
      refuse("a frame number", "\"" + key + "\"");
    if (!by_frame.emplace(frame, label.dump()).second) {
      refuse("each frame once", "frame " + std::to_string(frame) + " twice");
    }
  }
  return by_frame;
}

}  // namespace eventgan

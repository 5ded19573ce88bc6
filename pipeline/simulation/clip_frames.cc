#include "pipeline/simulation/clip_frames.h"

#include <limits>
#include <opencv2/imgproc.hpp>

#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/decoding/video_clip.h"
#include "stages/frames/listing/image_folder.h"

namespace eventgan {

namespace {

// OpenCV takes no const data; nothing writes to it here.
cv::Mat matrix(ImageSize size, int type, const std::vector<std::uint8_t>& pixels) {
  return {size.height, size.width, type, const_cast<std::uint8_t*>(pixels.data())};
}

}  // namespace

GreyImage grey_image(const ColourFrame& frame) try {
  GreyImage grey{frame.size, std::vector<std::uint8_t>(frame.size.pixel_count())};
  cv::cvtColor(matrix(frame.size, CV_8UC3, frame.bgr), matrix(grey.size, CV_8UC1, grey.pixels),
               cv::COLOR_BGR2GRAY);
  return grey;
} catch (const cv::Exception&) {
  std::throw_with_nested(InputError("expected a frame of pixels, got none"));
}

Placement sensor_placement(ImageSize frame, std::optional<ImageSize> size) {
  ImageSpec spec;
  spec.size = size;
  spec.fit = ImageFit::kCrop;
  return place(frame, spec);
}

GreyImage sensor_image(const GreyImage& frame, std::optional<ImageSize> size) try {
  const Placement placement = sensor_placement(frame.size, size);
  const VisiblePart part = visible_part(placement);
  cv::Mat scaled;
  const bool shrinks = placement.scaled.width < frame.size.width;
  cv::resize(matrix(frame.size, CV_8UC1, frame.pixels), scaled,
             cv::Size(placement.scaled.width, placement.scaled.height), 0, 0,
             shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);

  GreyImage image{part.size, std::vector<std::uint8_t>(part.size.pixel_count())};
  cv::Mat cut(part.size.height, part.size.width, CV_8UC1, image.pixels.data());
  scaled(cv::Rect(part.scaled_x, part.scaled_y, part.size.width, part.size.height)).copyTo(cut);
  return image;
} catch (const cv::Exception&) {
  std::throw_with_nested(InputError("expected a frame that can be resized, got another"));
}

namespace {

namespace fs = std::filesystem;

constexpr double kUsualRate_hz = 30;
constexpr int kKeptFrames = 1;  // frames are asked for once and in order

/// The frames of a clip, timed by their own rate: all, or at least as many as were asked for.
struct ListedClip {
  double rate_hz = 0;
  std::vector<FrameRef> frames;
  std::string files;  ///< a line "NAME<tab>SIZE" for each
};

std::string file_line(const fs::path& file) {
  return file.filename().string() + '\t' + std::to_string(fs::file_size(file)) + '\n';
}

ListedClip list_video(const fs::path& path, std::optional<double> rate_hz, std::int64_t enough) {
  const VideoClip video = measure_video(path, enough);
  const double rate = rate_hz.value_or(video.frames_per_second.value_or(kUsualRate_hz));
  ListedClip clip{rate, {}, file_line(path)};
  const bool own_times = !rate_hz && !video.uneven_times_s.empty();
  for (std::int64_t i = 0; i < video.frame_count; ++i) {
    const double time_s = own_times ? video.time_s(i) : static_cast<double>(i) / rate;
    clip.frames.push_back({path.string(), i, i, time_s});
  }
  return clip;
}

ListedClip list_images(const fs::path& path, std::optional<double> rate_hz) {
  const ImageFolder folder = list_image_folder(path);
  const double rate = rate_hz.value_or(kUsualRate_hz);
  ListedClip clip{rate, {}, {}};
  for (const auto& [number, name] : folder.frames.frames()) {
    const auto steps = static_cast<double>(number) / static_cast<double>(folder.frames.stride());
    const auto index = static_cast<std::int64_t>(clip.frames.size());
    clip.frames.push_back({(path / name).string(), index, -1, steps / rate});
    clip.files += file_line(path / name);
  }
  return clip;
}

ListedClip list_clip(const fs::path& path, std::optional<double> rate_hz, std::int64_t enough) {
  if (!fs::exists(path)) {
    throw InputError("expected a video or a folder of images, got none, in " + path.string());
  }
  return is_video_name(path) ? list_video(path, rate_hz, enough) : list_images(path, rate_hz);
}

/// Frames a clip must have for the source, counted from its own first.
std::int64_t frames_needed(const SimulationSource& source) {
  if (source.frame_count == 0) return std::numeric_limits<std::int64_t>::max();
  return source.first_frame + (source.frame_count - 1) * source.frame_step + 1;
}

}  // namespace

ClipFrames::ClipFrames(const SimulationSource& source, const SimulationManifest& manifest) try
    : path_(resolve(manifest, source.path)), size_(manifest.size), decoder_("", kKeptFrames) {
  const ListedClip clip = list_clip(path_, source.frames_per_second, frames_needed(source));
  rate_hz_ = clip.rate_hz;
  files_hash_ = sha256_hex(clip.files);
  const auto length = static_cast<std::int64_t>(clip.frames.size());
  const bool to_the_end = source.frame_count == 0;
  for (std::int64_t i = source.first_frame; i < length; i += source.frame_step) {
    if (!to_the_end && count() == source.frame_count) break;
    frames_.push_back(clip.frames[at(i)]);
    frames_.back().time_s -= clip.frames[at(source.first_frame)].time_s;
  }
  const std::int64_t least = !to_the_end                       ? source.frame_count
                             : source.method.moves_one_frame() ? 1
                                                               : 2;
  if (count() < least) {
    throw InputError("expected " + std::to_string(least) + " or more frames from frame " +
                     std::to_string(source.first_frame) + " on in steps of " +
                     std::to_string(source.frame_step) + ", got " + std::to_string(count()) +
                     " of a clip of " + std::to_string(length) + ", in " + path_.string());
  }
} catch (const fs::filesystem_error&) {
  std::throw_with_nested(InputError("expected a readable clip, got an error, in " + source.path));
}

GreyImage ClipFrames::frame(std::int64_t position) {
  const FrameRef& ref = frames_[at(position)];
  const Outcome<ColourFrame> decoded = decoder_.decode(ref, 1, ImageOrientation::kUpright);
  if (is_fault(decoded)) throw InputError(decoded.fault().reason);
  const auto& frame = *decoded;
  if (!frame_size_) frame_size_ = frame.size;
  if (frame.size != *frame_size_) {
    throw InputError("expected a frame of " + to_string(*frame_size_) + " as the first one, got " +
                     to_string(frame.size) + ", in " + ref.path);
  }
  return sensor_image(grey_image(frame), size_);
}

}  // namespace eventgan

#include "stages/base/videos/video_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/log.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>

#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

/// FFmpeg takes plain text for a video (it draws the letters), so text is kept from it.
bool is_text(const InputFile& file) {
  std::array<char, 512> start;
  const auto end = start.begin() + file.read_some(0, start);
  return std::find(start.begin(), end, '\0') == end;
}

/// By how many degrees clockwise frames are turned to be shown.
int rotation(const AVStream* stream) {
#if LIBAVFORMAT_VERSION_MAJOR >= 61
  const AVPacketSideData* const data =
      av_packet_side_data_get(stream->codecpar->coded_side_data,
                              stream->codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  const std::uint8_t* const matrix = data == nullptr ? nullptr : data->data;
#else
  const std::uint8_t* const matrix =
      av_stream_get_side_data(stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
#endif
  if (matrix == nullptr) return 0;
  const double angle = -av_display_rotation_get(reinterpret_cast<const std::int32_t*>(matrix));
  return std::isnan(angle) ? 0 : static_cast<int>(std::lround(angle) + 360) % 360;
}

double ratio(AVRational value) { return value.num == 0 || value.den == 0 ? 0 : av_q2d(value); }

}  // namespace

struct VideoFile::Decoder {
  AVFormatContext* format = nullptr;
  AVStream* stream = nullptr;  ///< of `format`
  AVCodecContext* codec = nullptr;
  AVPacket* packet = av_packet_alloc();
  AVFrame* frame = av_frame_alloc();  ///< the latest
  AVFrame* bgr = av_frame_alloc();    ///< the same in colour
  SwsContext* to_bgr = nullptr;
  int degrees = 0;
  cv::Size size;  ///< of all frames, as stored
  cv::Mat image;  ///< the latest frame as it is shown

  Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() {
    sws_freeContext(to_bgr);
    av_frame_free(&bgr);
    av_frame_free(&frame);
    av_packet_free(&packet);
    avcodec_free_context(&codec);
    avformat_close_input(&format);
  }

  bool open(const std::filesystem::path& path) {
    // "file:", since a name may look like another protocol's address.
    if (packet == nullptr || frame == nullptr || bgr == nullptr ||
        avformat_open_input(&format, ("file:" + path.string()).c_str(), nullptr, nullptr) < 0 ||
        avformat_find_stream_info(format, nullptr) < 0) {
      return false;
    }
    for (unsigned i = 0; i < format->nb_streams; ++i) {
      AVStream* const one = format->streams[i];
      const bool is_video = one->codecpar->codec_type == AVMEDIA_TYPE_VIDEO;
      if (is_video && stream == nullptr) {
        stream = one;
      } else {
        one->discard = AVDISCARD_ALL;
      }
    }
    if (stream == nullptr) return false;
    degrees = rotation(stream);
    const AVCodec* const decoder = avcodec_find_decoder(stream->codecpar->codec_id);
    codec = avcodec_alloc_context3(decoder);
    if (decoder == nullptr || codec == nullptr) return false;
    codec->thread_count =
        static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 16u));
    return avcodec_parameters_to_context(codec, stream->codecpar) >= 0 &&
           avcodec_open2(codec, decoder, nullptr) >= 0;
  }

  bool decode_next() {
    for (;;) {
      const int received = avcodec_receive_frame(codec, frame);
      if (received >= 0) return true;
      if (received == AVERROR_EOF) return false;
      int read = 0;
      do {
        av_packet_unref(packet);
        read = av_read_frame(format, packet);
      } while (read == AVERROR(EAGAIN) || (read >= 0 && packet->stream_index != stream->index));
      // None at the end: the decoder gives what it has held back.
      if (avcodec_send_packet(codec, read < 0 ? nullptr : packet) < 0) return false;
    }
  }

  /// Throws std::runtime_error.
  void convert() {
    const ImageSize shown{frame->height, frame->width};
    check_image_size(shown);
    if (size.empty()) size = {frame->width, frame->height};
    if (size != cv::Size(frame->width, frame->height)) {
      throw std::runtime_error("expected frames of " +
                               to_string(ImageSize{size.height, size.width}) + ", got one of " +
                               to_string(shown));
    }
    if (bgr->data[0] == nullptr) {
      bgr->format = AV_PIX_FMT_BGR24;
      bgr->width = (frame->width + 31) / 32 * 32;  // room for what is converted at once
      bgr->height = frame->height + 1;
      if (av_frame_get_buffer(bgr, 0) < 0) throw std::bad_alloc();
    }
    to_bgr = sws_getCachedContext(
        to_bgr, frame->width, frame->height, static_cast<AVPixelFormat>(frame->format),
        frame->width, frame->height, AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr, nullptr, nullptr);
    if (to_bgr == nullptr || sws_scale(to_bgr, frame->data, frame->linesize, 0, frame->height,
                                       bgr->data, bgr->linesize) <= 0) {
      throw std::runtime_error("expected frames of pixels, got others");
    }
    const cv::Mat stored(frame->height, frame->width, CV_8UC3, bgr->data[0],
                         static_cast<std::size_t>(bgr->linesize[0]));
    if (degrees == 90) {
      cv::rotate(stored, image, cv::ROTATE_90_CLOCKWISE);
    } else if (degrees == 180) {
      cv::rotate(stored, image, cv::ROTATE_180);
    } else if (degrees == 270) {
      cv::rotate(stored, image, cv::ROTATE_90_COUNTERCLOCKWISE);
    } else {
      stored.copyTo(image);
    }
  }
};

VideoFile::VideoFile(const std::filesystem::path& path) {
  // What is wrong with a file is thrown, not told on the standard error stream as well.
  av_log_set_level(AV_LOG_QUIET);
  std::string reason;
  const auto file = InputFile::open(path, reason);
  if (!file) throw std::runtime_error("expected a readable file, got '" + reason + "'");
  decoder_ = std::make_unique<Decoder>();
  if (is_text(*file) || !decoder_->open(path)) {
    throw std::runtime_error("expected a video, got a file that cannot be read as one");
  }
}

VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;

bool VideoFile::skip() {
  if (!decoder_->decode_next()) return false;
  ++position_;
  return true;
}

std::optional<ColourView> VideoFile::next() {
  if (!skip()) return std::nullopt;
  decoder_->convert();
  const cv::Mat& image = decoder_->image;
  return ColourView{{image.rows, image.cols}, image.data};
}

std::string video_libraries() { return std::string("FFmpeg ") + av_version_info(); }

double VideoFile::time_s() const {
  const std::int64_t ticks = decoder_->frame->best_effort_timestamp;
  return ticks == AV_NOPTS_VALUE ? std::numeric_limits<double>::quiet_NaN()
                                 : static_cast<double>(ticks) * ratio(decoder_->stream->time_base);
}

std::optional<double> VideoFile::frames_per_second() const {
  const double rate = ratio(av_guess_frame_rate(decoder_->format, decoder_->stream, nullptr));
  return rate > 0 ? std::optional(rate) : std::nullopt;
}

std::int64_t VideoFile::announced_count() const {
  const AVStream& stream = *decoder_->stream;
  const AVFormatContext& format = *decoder_->format;
  const bool has_edits = std::string_view(format.iformat->name).starts_with("mov");
  if (stream.nb_frames > 0 && !has_edits) return stream.nb_frames;
  // Where there is an edit list, the stream's duration is that of the frames that are shown.
  // Without one the container's counts, which may begin at 0 wherever the first frame is.
  const auto seconds = [](std::int64_t ticks, double tick_s) {
    return ticks == AV_NOPTS_VALUE ? 0 : static_cast<double>(ticks) * tick_s;
  };
  const double duration_s = stream.duration == AV_NOPTS_VALUE
                                ? seconds(format.duration, 1.0 / AV_TIME_BASE) -
                                      std::max(0.0, seconds(format.start_time, 1.0 / AV_TIME_BASE))
                                : seconds(stream.duration, ratio(stream.time_base));
  const double count = std::floor(duration_s * frames_per_second().value_or(0) + 0.5);
  if (!(count > 0 && count < 1e12)) return std::max<std::int64_t>(0, stream.nb_frames);
  const auto shown = static_cast<std::int64_t>(count);
  return stream.nb_frames > 0 ? std::min(stream.nb_frames, shown) : shown;
}

}  // namespace eventgan

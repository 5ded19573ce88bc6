extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/files/atomic_file.h"
#include "stages/base/videos/video_file.h"

namespace eventgan {
namespace {

/// Throws what FFmpeg's function says if it failed.
int checked(int result) {
  if (result >= 0) return result;
  char reason[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(result, reason, sizeof reason);
  throw std::runtime_error(reason);
}

template <class Pointer>
Pointer made(Pointer pointer) {
  if (pointer == nullptr) throw std::runtime_error("FFmpeg cannot make an MP4 of H.264");
  return pointer;
}

/// One MP4. All throw std::runtime_error with the reason alone.
class Mp4Writer {
 public:
  Mp4Writer() = default;
  Mp4Writer(const Mp4Writer&) = delete;
  Mp4Writer& operator=(const Mp4Writer&) = delete;
  ~Mp4Writer() {
    sws_freeContext(from_bgr_);
    av_frame_free(&frame_);
    av_packet_free(&packet_);
    avcodec_free_context(&codec_);
    if (format_ != nullptr) avio_closep(&format_->pb);
    avformat_free_context(format_);
  }

  /// For images of `size`.
  void open(const std::filesystem::path& path, ImageSize size, double frames_per_second) {
    size_ = size;
    width_ = (size.width + 1) / 2 * 2;
    height_ = (size.height + 1) / 2 * 2;
    const AVCodec* encoder = avcodec_find_encoder_by_name("libx264");
    if (encoder == nullptr) encoder = made(avcodec_find_encoder(AV_CODEC_ID_H264));
    codec_ = made(avcodec_alloc_context3(encoder));
    const AVRational rate = av_d2q(frames_per_second, 1'000'000);
    codec_->width = width_;
    codec_->height = height_;
    codec_->pix_fmt = AV_PIX_FMT_YUV420P;
    codec_->framerate = rate;
    codec_->time_base = av_inv_q(rate);
    codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    // x264 takes a quality; others need bits for it, here two a pixel in ten frames.
    if (av_opt_set(codec_->priv_data, "crf", "23", 0) < 0) {
      codec_->bit_rate = static_cast<std::int64_t>(0.2 * frames_per_second * width_ * height_);
    }
    if (avcodec_open2(codec_, encoder, nullptr) < 0) made<AVCodecContext*>(nullptr);

    checked(avformat_alloc_output_context2(&format_, nullptr, "mp4", nullptr));
    // So that the program knows its own videos again (OwnFile::kVideo).
    checked(av_dict_set(&format_->metadata, "comment", "eventgan preview", 0));
    stream_ = made(avformat_new_stream(format_, nullptr));
    checked(avcodec_parameters_from_context(stream_->codecpar, codec_));
    stream_->time_base = codec_->time_base;
    stream_->avg_frame_rate = rate;
    checked(avio_open(&format_->pb, ("file:" + path.string()).c_str(), AVIO_FLAG_WRITE));
    checked(avformat_write_header(format_, nullptr));

    packet_ = made(av_packet_alloc());
    frame_ = made(av_frame_alloc());
    frame_->format = codec_->pix_fmt;
    frame_->width = width_;
    frame_->height = height_;
    checked(av_frame_get_buffer(frame_, 0));
    from_bgr_ = made(sws_getContext(width_, height_, AV_PIX_FMT_BGR24, width_, height_,
                                    codec_->pix_fmt, SWS_BICUBIC, nullptr, nullptr, nullptr));
    padded_.resize(3ul * width_ * height_ + AV_INPUT_BUFFER_PADDING_SIZE);
  }

  void write(const ColourFrame& image) {
    if (image.size != size_) {
      throw std::runtime_error("expected images of " + to_string(size_) + ", got one of " +
                               to_string(image.size));
    }
    const std::size_t row_bytes = 3 * static_cast<std::size_t>(size_.width);
    for (int y = 0; y < size_.height; ++y) {
      std::copy_n(image.bgr.data() + y * row_bytes, row_bytes, padded_.data() + 3ul * y * width_);
    }
    checked(av_frame_make_writable(frame_));
    const std::uint8_t* const rows = padded_.data();
    const int stride = 3 * width_;
    checked(sws_scale(from_bgr_, &rows, &stride, 0, height_, frame_->data, frame_->linesize));
    frame_->pts = count_++;
    encode(frame_);
  }

  /// Writes what is left. Returns how many images there were.
  int finish() {
    encode(nullptr);
    checked(av_write_trailer(format_));
    checked(avio_closep(&format_->pb));  // tells of what could not be written before, too
    return count_;
  }

 private:
  void encode(const AVFrame* frame) {
    checked(avcodec_send_frame(codec_, frame));
    for (;;) {
      const int received = avcodec_receive_packet(codec_, packet_);
      if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
      checked(received);
      packet_->duration = 1;
      av_packet_rescale_ts(packet_, codec_->time_base, stream_->time_base);
      packet_->stream_index = stream_->index;
      checked(av_interleaved_write_frame(format_, packet_));
    }
  }

  ImageSize size_;
  int width_ = 0;  ///< of the frames
  int height_ = 0;
  int count_ = 0;
  std::vector<std::uint8_t> padded_;
  AVCodecContext* codec_ = nullptr;
  AVFormatContext* format_ = nullptr;
  AVStream* stream_ = nullptr;  ///< of `format_`
  AVPacket* packet_ = nullptr;
  AVFrame* frame_ = nullptr;
  SwsContext* from_bgr_ = nullptr;
};

}  // namespace

int write_video(const std::filesystem::path& path, double frames_per_second,
                const std::function<std::optional<ColourFrame>()>& next) {
  av_log_set_level(AV_LOG_QUIET);  // x264 tells of its work
  AtomicFile file(path);
  std::optional<Mp4Writer> writer;
  const auto naming_the_path = [&](const auto& step) {
    try {
      return step();
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("cannot write " + path.string() + ": " + error.what());
    }
  };
  while (const auto image = next()) {
    naming_the_path([&] {
      if (!writer) writer.emplace().open(file.temporary(), image->size, frames_per_second);
      writer->write(*image);
    });
  }
  if (!writer) throw std::runtime_error("cannot write " + path.string() + ": no images");
  const int count = naming_the_path([&] { return writer->finish(); });
  file.publish();
  return count;
}

}  // namespace eventgan

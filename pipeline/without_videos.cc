// In place of stages/base/videos in `eventgan`, which starts at once because it does not load
// FFmpeg either: its libraries take longer than all others together. What needs them is done by
// `eventgan-video`, the same program with them.

#include "pipeline/runtime/errors.h"
#include "stages/base/videos/video_file.h"

namespace eventgan {
namespace {

[[noreturn]] void hand_over() {
  throw HandOver{"eventgan-video", "install the package eventgan again"};
}

}  // namespace

struct VideoFile::Decoder {};

VideoFile::VideoFile(const std::filesystem::path&) { hand_over(); }
VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;
bool VideoFile::skip() { hand_over(); }
std::optional<ColourView> VideoFile::next() { hand_over(); }
double VideoFile::time_s() const { hand_over(); }
std::int64_t VideoFile::announced_count() const { hand_over(); }
std::optional<double> VideoFile::frames_per_second() const { hand_over(); }

int write_video(const std::filesystem::path&, double,
                const std::function<std::optional<ColourFrame>()>&) {
  hand_over();
}

std::string video_libraries() { hand_over(); }

}  // namespace eventgan

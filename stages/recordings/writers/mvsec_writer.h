#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// Writes a recording in MVSEC's HDF5 layout, frame by frame:
/// `davis/left/events` [N, 4] float64 (x, y, t in seconds, p = -1 or +1), `image_raw` [F, H, W]
/// uint8, `image_raw_ts` [F] float64, `image_raw_event_inds` [F] int64 (index of the last event at
/// or before the frame, -1 if none), and, as in MVSEC's ground-truth files, `flow_dist` [F-1, 2, H,
/// W] float32 (x, y in pixels) where flows are given. All chunked and compressed, with checksums.
///
/// The file appears under its name on commit() only, whole (atomic_file.h), in place of one that
/// was there before;
/// without it the destructor leaves nothing behind. The same calls give the same bytes, however the
/// events are portioned.
///
/// All members throw std::runtime_error naming the file, cause nested, on I/O errors, and
/// std::logic_error after commit(). Thread safety: one writer is for one thread; several writers
/// and recordings take turns by themselves.
class MvsecWriter {
 public:
  /// `settings` (UTF-8, without NUL) is kept as the root attribute `simulation`. Throws
  /// std::invalid_argument for an empty size.
  MvsecWriter(const std::filesystem::path& file, ImageSize size, const std::string& settings);
  ~MvsecWriter();

  /// Events since the frame before: in time order, all later than that frame, inside the image.
  /// May be called several times between two frames, and before the first and after the last frame.
  /// Throws std::invalid_argument if these rules are broken; then nothing was added.
  void add_events(std::span<const Event> events);

  /// A frame later than the one before and not earlier than any event so far. `flow` is
  /// that of the interval since the frame before: for all frames but the first, or for none.
  /// Throws std::invalid_argument if these rules are broken; then nothing was added.
  void add_frame(const GreyImage& frame, double time_s, const FlowField* flow_from_previous);

  /// Publishes the file; std::logic_error if it has no frame. `before_publishing` is called once
  /// all is on disk under the temporary name: what it throws ends this, and the target is what it
  /// was.
  void commit(const std::function<void()>& before_publishing = {});

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace eventgan

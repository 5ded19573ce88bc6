#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace eventgan {

/// Where an HDF5 file has a dataset for each column of its events: whole numbers [events], x and y
/// in pixels, t in µs, p 0 or 1 (or -1 or 1, or a bool).
struct ColumnLayout {
  std::string events;  ///< the group of the columns
  /// Whole numbers [ms]: the first event at or after each ms; empty or absent: there is none.
  std::string ms_index = {};
  std::string t_offset = {};  ///< µs, added to t; likewise
  /// Of the sensor: [width, height], or height and width; likewise.
  std::vector<std::string> size = {};
  std::string ending = {};      ///< of the columns' names: "s" where they are xs, ys, ts, ps
  bool counts_seconds = false;  ///< t is seconds, float

  std::string column(const std::string& name) const { return events + "/" + name + ending; }
};

/// DSEC's, as EventColumnsWriter writes it, too. Files of RVT and Prophesee (NAME_td.h5) are read
/// as well, which have no index and no offset, but height and width.
ColumnLayout dsec_layout();

/// M3ED's, of one camera: "left" or "right".
ColumnLayout m3ed_layout(const std::string& camera);

/// Where a recording's datasets lie in an HDF5 file.
struct Hdf5Layout {
  std::string events;       ///< [events, 4]: x, y, t, p in the order of `columns`
  std::string frames;       ///< [frames, height, width] uint8
  std::string frame_times;  ///< [frames], as the events' times
  std::string
      event_index;   ///< [frames] integers near the last event before the frame; may be absent
  std::string flow;  ///< [frames - 1, 2, height, width] float; may be absent
  std::array<std::size_t, 4> columns = {0, 1, 2, 3};  ///< where events has x, y, t and p
  double ticks_per_s = 1;  ///< of times; 1: all numbers are float, else whole
  bool may_lack_frames = false;
};

/// MVSEC's, of one camera: "left" or "right".
Hdf5Layout mvsec_layout(const std::string& camera);

/// The EventGAN authors', which has no flow.
Hdf5Layout eventgan_layout();

/// v2e's (--dvs_h5): t in µs, x, y and p of 0 or 1; frames only where it was told to keep them.
Hdf5Layout v2e_layout();

}  // namespace eventgan

#include "stages/recordings/readers/hdf5_layouts.h"

namespace eventgan {

ColumnLayout dsec_layout() {
  return {.events = "events",
          .ms_index = "ms_to_idx",
          .t_offset = "t_offset",
          .size = {"events/height", "events/width"}};
}

ColumnLayout m3ed_layout(const std::string& camera) {
  const std::string group = "prophesee/" + camera;
  return {
      .events = group, .ms_index = group + "/ms_map_idx", .size = {group + "/calib/resolution"}};
}

Hdf5Layout mvsec_layout(const std::string& camera) {
  const std::string group = "davis/" + camera + "/";
  return {group + "events", group + "image_raw", group + "image_raw_ts",
          group + "image_raw_event_inds", group + "flow_dist"};
}

Hdf5Layout eventgan_layout() {
  return {"davis/events/data", "davis/image_raw/data", "davis/image_raw/timestamps",
          "davis/image_raw/event_index", ""};
}

Hdf5Layout v2e_layout() {
  return {.events = "events",
          .frames = "frame",
          .frame_times = "frame_ts",
          .event_index = "frame_idx",
          .flow = "",
          .columns = {1, 2, 0, 3},
          .ticks_per_s = 1e6,
          .may_lack_frames = true};
}

}  // namespace eventgan

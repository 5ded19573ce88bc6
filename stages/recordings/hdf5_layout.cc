#include "stages/recordings/hdf5_layout_internal.h"

namespace eventgan {

Hdf5Layout mvsec_layout(const std::string& camera) {
  const std::string group = "davis/" + camera + "/";
  return {group + "events", group + "image_raw", group + "image_raw_ts",
          group + "image_raw_event_inds", group + "flow_dist"};
}

Hdf5Layout eventgan_layout() {
  return {"davis/events/data", "davis/image_raw/data", "davis/image_raw/timestamps",
          "davis/image_raw/event_index", ""};
}

}  // namespace eventgan

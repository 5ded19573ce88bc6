#include <algorithm>

#include "stages/hdf5/hdf5_handle_internal.h"

namespace eventgan {
namespace {

/// HDF5 walks from the failed call inwards; the last description is nearest to the cause.
herr_t keep_description(unsigned, const H5E_error2_t* error, void* reason) {
  if (error->desc != nullptr) *static_cast<std::string*>(reason) = error->desc;
  return 0;
}

}  // namespace

void quiet_hdf5_errors() {
  thread_local const herr_t quiet = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  static_cast<void>(quiet);
}

void throw_hdf5_error(const char* action, const std::string& object) {
  std::string reason = "unknown reason";
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, keep_description, &reason);
  // The file drivers wrap the system's message in addresses and times: "..., error message = 'No
  // space left on device', ...".
  const std::string before = "error message = '";
  if (const std::size_t begin = reason.find(before); begin != std::string::npos) {
    reason.erase(0, begin + before.size());
    reason.erase(std::min(reason.find('\''), reason.size()));
  }
  throw Hdf5Error("cannot " + std::string(action) + " " + object + ": " + reason);
}

}  // namespace eventgan

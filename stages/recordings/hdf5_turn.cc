#include "stages/hdf5/hdf5_handle_internal.h"
#include "stages/recordings/hdf5_turn_internal.h"

namespace eventgan {
namespace {

std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

Hdf5Turn::Hdf5Turn() : lock_(hdf5_mutex()) { quiet_hdf5_errors(); }

}  // namespace eventgan

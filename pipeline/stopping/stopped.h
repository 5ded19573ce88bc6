#pragma once

#include <stdexcept>

namespace eventgan {

/// Asked to stop before anything was begun. Exit code 75.
class Stopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace eventgan

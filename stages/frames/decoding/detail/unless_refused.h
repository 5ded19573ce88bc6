#pragma once

#include <exception>
#include <opencv2/core.hpp>
#include <stdexcept>

namespace eventgan {

/// What `prepare` returns; what OpenCV and `place` throw becomes a std::runtime_error.
template <class Prepare>
auto unless_refused(Prepare prepare) {
  try {
    return prepare();
  } catch (const cv::Exception& exception) {
    std::throw_with_nested(
        std::runtime_error("expected frames that can be resized, got " + exception.err));
  } catch (const std::invalid_argument& exception) {
    std::throw_with_nested(std::runtime_error(exception.what()));
  }
}

}  // namespace eventgan

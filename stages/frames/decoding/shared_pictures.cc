#include "stages/frames/decoding/shared_pictures.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace eventgan {

SharedPictures::SharedPictures(std::size_t most) : most_(std::max<std::size_t>(most, 1)) {}

SharedFrame SharedPictures::get(const std::string& name, const std::function<SharedFrame()>& make) {
  std::promise<SharedFrame> promise;
  {
    std::unique_lock lock(mutex_);
    if (const auto found = by_name_.find(name); found != by_name_.end()) {
      pictures_.splice(pictures_.begin(), pictures_, found->second);
      const std::shared_future<SharedFrame> frame = found->second->frame;
      lock.unlock();
      return frame.get();
    }
    add(name, promise.get_future().share());
  }
  try {
    SharedFrame frame = make();
    promise.set_value(frame);
    return frame;
  } catch (...) {
    promise.set_exception(std::current_exception());
    throw;
  }
}

void SharedPictures::add(const std::string& name, std::shared_future<SharedFrame> frame) {
  pictures_.push_front({name, std::move(frame)});
  by_name_[pictures_.front().name] = pictures_.begin();
  if (pictures_.size() <= most_) return;
  by_name_.erase(pictures_.back().name);
  pictures_.pop_back();
}

}  // namespace eventgan

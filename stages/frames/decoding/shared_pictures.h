#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <list>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>

#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

/// The pictures used last, so that pairs that share a frame decode it once.
///
/// Thread safe. Of several threads that want one picture at the same time the first makes it and
/// the others wait for it; no lock is held meanwhile, so pictures are made in parallel. A thread
/// waits only for one that is making a picture and itself waits for none: no deadlock.
class SharedPictures {
 public:
  /// Keeps `most` pictures (at least one), whatever their size.
  explicit SharedPictures(std::size_t most);

  /// The picture of that name: kept, or under way in another thread, or else what `make` returns
  /// (never null). A fault is kept like a picture, and so is what `make` throws: every `get` that
  /// finds it throws the same. `make` must not call `get`, nor lend its thread to tasks that may
  /// (as an algorithm that runs in parallel in the same thread pool does).
  SharedFrame get(const std::string& name, const std::function<SharedFrame()>& make);

 private:
  struct Picture {
    std::string name;
    std::shared_future<SharedFrame> frame;
  };

  /// Puts a promised picture in front, and the one unused for longest out.
  void add(const std::string& name, std::shared_future<SharedFrame> frame);

  std::size_t most_;
  std::mutex mutex_;
  std::list<Picture> pictures_;  ///< most recently used first
  std::unordered_map<std::string_view, std::list<Picture>::iterator> by_name_;
};

}  // namespace eventgan

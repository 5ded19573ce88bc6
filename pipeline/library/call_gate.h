#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

namespace eventgan {

/// What every call of the library passes, pair by pair, so that nothing of it is under way where a
/// process forks or ends.
///
/// A fork copies the locks of this library and of those that it uses (oneDNN's cache of kernels)
/// as they are at that moment, and of the threads only its own: a lock that another thread held
/// would stay locked for ever in the child. So fork() closes the gate, waits until nobody is
/// inside, and opens it again in the parent and in the child. It waits no longer than for one pair
/// of images. The end of a process is like it: its handlers destroy what the calls use.
///
/// Thread safe. Nobody may pass it again who is inside, and nobody inside may fork.
class CallGate {
 public:
  /// The process's. It lives for ever.
  static CallGate& instance();

  /// Inside as long as this lives.
  class Pass {
   public:
    Pass() { instance().enter(); }
    ~Pass() { instance().leave(); }
    Pass(const Pass&) = delete;
    Pass& operator=(const Pass&) = delete;
  };

  /// Waits until nobody is inside; then only this thread passes any more.
  void end();

 private:
  CallGate();
  void enter();
  void leave();
  void close();
  void open();
  void open_in_child();

  std::mutex mutex_;
  std::condition_variable changed_;
  int inside_ = 0;
  int closed_ = 0;  ///< forks that wait for the gate, or have it
  bool ended_ = false;
  std::thread::id ending_;
};

}  // namespace eventgan

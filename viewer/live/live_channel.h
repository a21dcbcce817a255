// One stream for all who look on: its pictures are encoded once, on a thread of low priority, and only while
// somebody watches. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/bytes.h"
#include "recorder/picture_tap.h"

namespace kiroku::live {

/// Somebody who watches. Called from the channel's thread; must not wait.
class Watcher {
 public:
  virtual ~Watcher() = default;
  /// What follows begins anew, with a key frame: after joining, when the source changed, with each case.
  /// False if it could not be taken: then it is called again with the next key frame.
  virtual bool begin(const std::shared_ptr<const Bytes>& init_segment, const std::string& codecs) = 0;
  /// False if it could not be taken: then nothing is sent until the next key frame.
  virtual bool take(const std::shared_ptr<const Bytes>& fragment, std::int64_t time_ns) = 0;
};

class LiveChannel {
 public:
  /// `tell` hears what goes wrong, one sentence each.
  LiveChannel(std::shared_ptr<recorder::PictureTap> tap, std::function<void(const std::string&)> tell);
  ~LiveChannel();
  LiveChannel(const LiveChannel&) = delete;
  LiveChannel& operator=(const LiveChannel&) = delete;

  /// Until remove(); nothing is sent before the first key frame.
  void add(std::shared_ptr<Watcher> watcher);
  /// After it has returned the watcher is not called any more.
  void remove(const Watcher* watcher);

 private:
  struct Place {
    std::shared_ptr<Watcher> watcher;
    bool has_begun = false;  // has the initialisation segment of what is encoded now
    bool waits_for_key = true;
  };
  void run();

  const std::shared_ptr<recorder::PictureTap> tap_;
  const std::function<void(const std::string&)> tell_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Place> places_;
  bool newcomer_ = false, ending_ = false;
  std::thread thread_;
};

}  // namespace kiroku::live

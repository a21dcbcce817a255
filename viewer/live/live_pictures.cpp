#include "viewer/live/live_pictures.h"

#include <nlohmann/json.hpp>

namespace kiroku::live {
namespace {

/// What a browser is sent: of each beginning a text message, then the initialisation segment, then fragments.
class BrowserWatcher final : public Watcher {
 public:
  BrowserWatcher(std::shared_ptr<viewer::SocketOutput> output, std::shared_ptr<viewer::Session> session)
      : output_(std::move(output)), session_(std::move(session)) {}
  bool begin(const std::shared_ptr<const Bytes>& init_segment, const std::string& codecs) override {
    return output_->send_text(nlohmann::json{{"codecs", codecs}}.dump()) && output_->send_bytes(init_segment);
  }
  bool take(const std::shared_ptr<const Bytes>& fragment, std::int64_t /*time_ns*/) override {
    if (!output_->send_bytes(fragment)) return false;
    // To look on is a deed, as playing a film is.
    viewer::SessionStore::note_activity(*session_);
    return true;
  }

 private:
  std::shared_ptr<viewer::SocketOutput> output_;
  std::shared_ptr<viewer::Session> session_;
};

class LiveSocket final : public viewer::SocketHandler {
 public:
  LiveSocket(LiveChannel& channel, std::shared_ptr<BrowserWatcher> watcher)
      : channel_(channel), watcher_(std::move(watcher)) {
    channel_.add(watcher_);
  }
  ~LiveSocket() override { channel_.remove(watcher_.get()); }
  LiveSocket(const LiveSocket&) = delete;
  LiveSocket& operator=(const LiveSocket&) = delete;
  void receive(const viewer::SocketMessage& /*message*/) override {
    throw viewer::Refusal(400, "live pictures take no messages");
  }

 private:
  LiveChannel& channel_;
  std::shared_ptr<BrowserWatcher> watcher_;
};

}  // namespace

viewer::LivePictures live_pictures(const Channels& channels) {
  viewer::LivePictures pictures;
  for (const auto& [name, channel] : channels) pictures.streams.push_back({name.first, name.second});
  pictures.watch = [&channels](const viewer::LiveStream& stream, std::shared_ptr<viewer::Session> session,
                               std::shared_ptr<viewer::SocketOutput> output) {
    return std::make_unique<LiveSocket>(
        *channels.at({stream.room, stream.stream}),
        std::make_shared<BrowserWatcher>(std::move(output), std::move(session)));
  };
  return pictures;
}

}  // namespace kiroku::live

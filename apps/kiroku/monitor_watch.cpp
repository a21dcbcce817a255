#include "apps/kiroku/monitor_watch.h"

#include <algorithm>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "base/error.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/hl7_patient_part.h"
#include "recorder/vitals/hl7_refusal.h"
#include "recorder/vitals/mllp_address.h"

namespace kiroku::apps {
namespace {

/// Whoever reaches the port is heard, so what is kept of them is bounded.
constexpr std::size_t kMostMonitors = 64, kMostNames = 64, kLongestName = 80;

std::string shortened(std::string text) {
  if (text.size() > kLongestName) text.resize(kLongestName);
  return text;
}

void add_name(std::set<std::string>& names, const std::string& name) {
  if (!name.empty() && names.size() < kMostNames) names.insert(shortened(name));
}

/// What was heard so far; used by the server's thread and by the one that waits.
class Heard {
 public:
  explicit Heard(std::function<void(const std::string&)> tell) : tell_(std::move(tell)) {}
  void take(std::string_view bytes, const std::string& peer) {
    const recorder::Hl7Parse parse = recorder::parse_hl7_message(bytes);
    const std::lock_guard lock(mutex_);
    HeardMonitor* const monitor = entry(peer, parse.message ? shortened(parse.message->sender()) : "");
    if (monitor == nullptr) return;
    if (!parse.message) {
      monitor->problem = parse.problem;
      return;
    }
    if (const auto refusal = recorder::refusal_of(*parse.message)) monitor->problem = refusal->why;
    ++monitor->messages;
    add_name(monitor->types, parse.message->type());
    for (const recorder::PatientPart& part : recorder::patient_parts(*parse.message)) {
      add_name(monitor->places, part.place);
    }
    for (const recorder::Hl7Segment& segment : parse.message->segments()) {
      if (segment.name() != "OBX") continue;
      const std::string words = segment.field(3).component(2).text();
      add_name(monitor->quantities, words.empty() ? segment.field(3).component(1).text() : words);
    }
  }
  void complain(const std::string& text, const std::string& peer) {
    const std::lock_guard lock(mutex_);
    if (HeardMonitor* const monitor = entry(peer, "")) monitor->problem = text;
  }
  [[nodiscard]] std::vector<HeardMonitor> all() const {
    const std::lock_guard lock(mutex_);
    return monitors_;
  }

 private:
  HeardMonitor* entry(const std::string& address, const std::string& sender) {
    const auto found = std::find_if(monitors_.begin(), monitors_.end(), [&](const HeardMonitor& one) {
      return one.address == address && one.sender == sender;
    });
    if (found != monitors_.end()) return &*found;
    if (monitors_.size() == kMostMonitors) return nullptr;
    HeardMonitor monitor;
    monitor.address = address;
    monitor.sender = sender;
    monitors_.push_back(std::move(monitor));
    if (!sender.empty()) tell_("heard " + address + ", " + sender);
    return &monitors_.back();
  }

  const std::function<void(const std::string&)> tell_;
  mutable std::mutex mutex_;  // guards what follows
  std::vector<HeardMonitor> monitors_;
};

}  // namespace

HeardMonitors listen_for_monitors(const std::string& address, std::chrono::nanoseconds how_long,
                                  const std::function<void(const std::string&)>& tell,
                                  const std::function<bool()>& enough) {
  const recorder::SourceAddress parsed =
      recorder::parse_source_address(address, recorder::Presence::kNotLookedAt);
  if (parsed.kind != recorder::SourceKind::kMonitors) {
    throw UsageError("monitors are waited for at an address such as mllp://0.0.0.0:2575, not at '" +
                     parsed.stated + "'");
  }
  recorder::MllpServer::Options options = recorder::mllp_server_options(parsed);
  // Nothing of what comes is kept, so whoever reaches the port may be told of.
  if (options.allowed.empty() && options.clients.empty()) options.allow_anybody = true;
  Heard heard(tell);
  recorder::MllpServer server(
      options,
      [&heard](std::string_view message,
               const std::string& peer) -> std::optional<recorder::MllpServer::Answer> {
        heard.take(message, peer);
        return recorder::MllpServer::Answer{};
      },
      [&heard](const std::string&, const std::string& text, const std::string& peer) {
        heard.complain(text, peer);
      });
  const std::string host =
      options.address.find(':') == std::string::npos ? options.address : "[" + options.address + "]";
  const std::string scheme = parsed.location.substr(0, parsed.location.find("://"));
  const std::string listened_at = scheme + "://" + host + ":" + std::to_string(server.port());
  server.start();
  tell("waiting for monitors at " + listened_at + "; nothing is kept or acknowledged");
  constexpr std::chrono::milliseconds kStep{50};
  const auto until = std::chrono::steady_clock::now() + how_long;
  while (!enough() && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(kStep);
  server.stop();
  return {heard.all(), listened_at};
}

std::string source_for(const HeardMonitor& monitor, const std::string& listened_at) {
  std::string source = listened_at + "?allow=" + monitor.address;
  // In an address these would mean something else.
  const bool fits = monitor.sender.find_first_of(",&?#\"\\") == std::string::npos;
  if (fits && !monitor.sender.empty() && !monitor.sender.starts_with('/')) {
    source += "&sender=" + monitor.sender;
  }
  return source;
}

}  // namespace kiroku::apps

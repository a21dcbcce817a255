#include "recorder/daemon/footswitch.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <linux/input.h>
#include <mutex>
#include <optional>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr const char* kInputFolder = "/dev/input";
constexpr std::string_view kByName = "name:";
constexpr int kPress = 1;  // the value of an EV_KEY event; 0 is a release, 2 a repetition

Descriptor open_quietly(const std::filesystem::path& file) {
  return Descriptor(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
}

std::string name_of(const Descriptor& device) {
  std::array<char, 256> name{};
  if (::ioctl(device.number(), EVIOCGNAME(name.size() - 1), name.data()) < 0) return "";
  return name.data();
}

std::string place_of(const Descriptor& device) {
  std::array<char, 256> place{};
  if (::ioctl(device.number(), EVIOCGPHYS(place.size() - 1), place.data()) < 0) return "";
  return place.data();
}

std::string unique_of(const Descriptor& device) {
  std::array<char, 256> unique{};
  if (::ioctl(device.number(), EVIOCGUNIQ(unique.size() - 1), unique.data()) < 0) return "";
  return unique.data();
}

enum class HasKey { kYes, kNo, kUnknown };

HasKey has_key(const Descriptor& device, std::uint16_t key) {
  // What is no input device (a pipe) cannot say which keys it has.
  std::array<unsigned char, KEY_MAX / 8 + 1> keys{};
  if (::ioctl(device.number(), EVIOCGBIT(EV_KEY, keys.size()), keys.data()) < 0) return HasKey::kUnknown;
  return (keys.at(key / 8U) & (1U << (key % 8U))) != 0 ? HasKey::kYes : HasKey::kNo;
}

/// Of all input devices the one that is called so.
Descriptor open_by_name(const std::string& name, std::uint16_t key) {
  std::error_code error;
  std::vector<std::filesystem::path> events;
  for (const auto& entry : std::filesystem::directory_iterator(kInputFolder, error)) {
    if (entry.path().filename().string().starts_with("event")) events.push_back(entry.path());
  }
  std::sort(events.begin(), events.end());
  std::filesystem::path refused;
  std::vector<InputDevice> named;
  for (const std::filesystem::path& event : events) {
    const Descriptor device = open_quietly(event);
    if (device.number() < 0 && errno == EACCES) refused = event;
    if (device.number() >= 0 && name_of(device) == name)
      named.push_back({event, place_of(device), has_key(device, key) == HasKey::kYes, unique_of(device)});
  }
  if (!named.empty()) {
    const std::filesystem::path chosen = choose_by_name(name, named);
    Descriptor device = open_quietly(chosen);
    if (device.number() < 0) throw IoError("open the footswitch", chosen, errno);
    return device;
  }
  if (!refused.empty()) throw IoError("look for the footswitch '" + name + "' at", refused, EACCES);
  throw Error("there is no input device named '" + name + "' that may be read");
}

/// Throws kiroku::Error where the device is not there, may not be read, or has no such key.
Descriptor open_device(const FootswitchOptions& options) {
  Descriptor device;
  if (options.device.starts_with(kByName)) {
    device = open_by_name(options.device.substr(kByName.size()), options.key);
  } else {
    device = open_quietly(options.device);
    if (device.number() < 0) throw IoError("open the footswitch", options.device, errno);
  }
  if (has_key(device, options.key) == HasKey::kNo)
    throw Error("the footswitch " + options.device + " has no key " + std::to_string(options.key));
  return device;
}

/// Becomes readable when something changes where the device would appear: in its folder, or in the nearest
/// one above that exists. None where that cannot be told.
Descriptor watch_for(const std::string& device) {
  Descriptor changes(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK));
  std::filesystem::path folder =
      device.starts_with(kByName) ? kInputFolder : std::filesystem::path(device).parent_path();
  std::error_code error;
  while (!std::filesystem::is_directory(folder, error) && folder.has_relative_path())
    folder = folder.parent_path();
  // Its permissions are set after it was made.
  constexpr std::uint32_t kAppears = IN_CREATE | IN_MOVED_TO | IN_ATTRIB;
  if (::inotify_add_watch(changes.number(), folder.c_str(), kAppears) < 0) return Descriptor();
  return changes;
}

}  // namespace

std::filesystem::path choose_by_name(const std::string& name, const std::vector<InputDevice>& devices) {
  // A keyboard shows itself as several devices of one name: parts of one thing.
  const auto thing = [](const InputDevice& device) {
    const std::string place =
        device.place.empty() ? device.node.string() : device.place.substr(0, device.place.rfind('/'));
    return place + "\n" + device.unique;
  };
  const InputDevice* chosen = nullptr;
  std::string nodes;
  bool several = false;
  for (const InputDevice& device : devices) {
    if (!device.has_key) continue;
    nodes += (nodes.empty() ? "" : ", ") + device.node.string();
    if (chosen == nullptr) chosen = &device;
    several = several || thing(device) != thing(*chosen);
  }
  if (several) {
    throw Error("several footswitches are named '" + name + "' (" + nodes +
                "), and nobody can tell whose presses are meant: in kiroku.toml write the path of this one "
                "below /dev/input/by-path");
  }
  return chosen == nullptr ? devices.front().node : chosen->node;
}

void try_footswitch(const FootswitchOptions& options) { open_device(options); }

std::string_view press_action_name(PressAction action) {
  switch (action) {
    case PressAction::kStart:
      return "start";
    case PressAction::kStop:
      return "stop";
    case PressAction::kStartStop:
      return "start-stop";
    case PressAction::kMark:
      return "mark";
    case PressAction::kProfile:
      return "profile";
  }
  return "";
}

struct Footswitch::State {
  State(FootswitchOptions asked, Pressed act, Tell told, const Clock& its_time)
      : options(std::move(asked)),
        pressed(std::move(act)),
        tell(std::move(told)),
        time(its_time),
        end(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (end.number() < 0) throw IoError("wait for the footswitch", options.device, errno);
    thread = std::thread([this] { run(); });
  }
  ~State() {
    constexpr std::uint64_t kOne = 1;
    (void)!::write(end.number(), &kOne, sizeof kOne);
    thread.join();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void run() {
    auto pause = options.first_pause;
    for (;;) {
      // First, so that what appears after it was looked for is not missed.
      const Descriptor changes = watch_for(options.device);
      try {
        const Descriptor device = open_device(options);
        set_problem("");
        pause = options.first_pause;
        if (read_presses(device)) return;
      } catch (const std::exception& error) {
        set_problem(error.what());
      }
      if (is_over(pause, changes)) return;
      pause = std::min(2 * pause, options.longest_pause);
    }
  }

  /// Until the end, which it returns true for; throws kiroku::Error where the device is lost.
  bool read_presses(const Descriptor& device) {
    // What is no input device says its times by the wall clock, as input devices do that are not asked.
    const int monotonic = CLOCK_MONOTONIC;
    event_clock = ::ioctl(device.number(), EVIOCSCLOCKID, &monotonic) == 0 ? CLOCK_MONOTONIC : CLOCK_REALTIME;
    last_deed.reset();
    std::array<input_event, 64> events{};
    for (;;) {
      std::array<pollfd, 2> waiting{pollfd{device.number(), POLLIN, 0}, pollfd{end.number(), POLLIN, 0}};
      if (::poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) {
        throw IoError("wait for the footswitch", options.device, errno);
      }
      if (waiting[1].revents != 0) return true;
      if (waiting[0].revents == 0) continue;
      const ssize_t bytes = ::read(device.number(), events.data(), sizeof events);
      if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) continue;
      if (bytes <= 0) throw Error("the footswitch " + options.device + " is not there any more");
      const std::size_t count = static_cast<std::size_t>(bytes) / sizeof(input_event);
      for (std::size_t i = 0; i < count; ++i) {
        if (events.at(i).type != EV_KEY || events.at(i).code != options.key || events.at(i).value != kPress)
          continue;
        press(time_of(events.at(i)));
      }
    }
  }

  /// `pressed_at`, by the clock of the device's events; 0: it does not say.
  void press(std::chrono::nanoseconds pressed_at) {
    const Clock::Time now = time.now();
    if (last_press && now - *last_press < options.bounce) return;
    last_press = now;
    {
      const std::lock_guard guard(mutex);
      ++presses;
    }
    // Who presses again because nothing seems to happen does not want the opposite. A mark is of a moment.
    if (options.action != PressAction::kMark && last_deed && pressed_at >= last_deed->first &&
        pressed_at < last_deed->second) {
      if (tell) tell("a press of the footswitch did nothing: the one before it was still being acted on");
      return;
    }
    const std::chrono::nanoseconds begun = event_time_now();
    try {
      pressed(pressed_at.count() == 0 ? pressed_at
                                      : std::max(begun - pressed_at, std::chrono::nanoseconds(0)));
    } catch (const std::exception& error) {
      if (tell) tell(std::string("a press of the footswitch did nothing: ") + error.what());
    }
    last_deed = {begun, event_time_now()};
  }

  [[nodiscard]] static std::chrono::nanoseconds time_of(const input_event& event) {
    return std::chrono::seconds(event.input_event_sec) + std::chrono::microseconds(event.input_event_usec);
  }
  [[nodiscard]] std::chrono::nanoseconds event_time_now() const {
    timespec now{};
    ::clock_gettime(event_clock, &now);
    return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
  }

  /// Whether the end came within the time; waits no longer once something changed.
  [[nodiscard]] bool is_over(std::chrono::milliseconds limit, const Descriptor& changes) const {
    std::array<pollfd, 2> waiting{pollfd{end.number(), POLLIN, 0}, pollfd{changes.number(), POLLIN, 0}};
    return ::poll(waiting.data(), waiting.size(), static_cast<int>(limit.count())) > 0 &&
           waiting[0].revents != 0;
  }

  void set_problem(const std::string& sentence) {
    std::string before;
    {
      const std::lock_guard guard(mutex);
      opened = sentence.empty();
      before = std::exchange(problem, sentence);
    }
    if (!tell || before == sentence) return;
    tell(sentence.empty() ? "the footswitch " + options.device + " is there"
                          : sentence + "; it is looked for again");
  }

  const FootswitchOptions options;
  const Pressed pressed;
  const Tell tell;
  const Clock& time;
  const Descriptor end;
  mutable std::mutex mutex;  // guards the next three
  bool opened = false;
  std::string problem;
  std::uint64_t presses = 0;
  // The thread's: the clock of the device's events, and by it when the last press was acted on.
  clockid_t event_clock = CLOCK_REALTIME;
  std::optional<std::pair<std::chrono::nanoseconds, std::chrono::nanoseconds>> last_deed;
  std::optional<Clock::Time> last_press;
  std::thread thread;
};

Footswitch::Footswitch(FootswitchOptions options, Pressed pressed, Tell tell, const Clock& time)
    : state_(std::make_unique<State>(std::move(options), std::move(pressed), std::move(tell), time)) {}

Footswitch::~Footswitch() = default;

FootswitchStatus Footswitch::status() const {
  const std::lock_guard guard(state_->mutex);
  FootswitchStatus status{state_->options.device, state_->opened, state_->problem, state_->presses};
  if (state_->opened) status.state = "is there; " + std::to_string(state_->presses) + " presses";
  if (status.state.empty()) status.state = "is being looked for";
  return status;
}

}  // namespace kiroku::recorder

// A footswitch or another switch with keys, as Linux shows it (evdev: /dev/input/event…, linux/input.h).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "recorder/encoder/video_profile.h"

namespace kiroku::recorder {

/// What a press does to its room. kStartStop: begins a case where none runs, else ends it.
/// kProfile: pictures are archived in another form from here on.
enum class PressAction { kStart, kStop, kStartStop, kMark, kProfile };
std::string_view press_action_name(PressAction action);

struct FootswitchOptions {
  /// A path, best below /dev/input/by-id, of two equal devices below /dev/input/by-path; or "name:…", the
  /// name by which the kernel lists it (/proc/bus/input/devices), where one device alone has it.
  std::string device;
  std::uint16_t key = 0;  // KEY_… or BTN_… of linux/input-event-codes.h
  PressAction action = PressAction::kStartStop;
  std::string mark = "footswitch";       // text of a mark
  Profile profile = Profile::kLossless;  // of kProfile
  std::vector<std::string> streams;      // of kProfile; none: all of pictures
  /// A press so soon after another is the same one: contacts bounce.
  std::chrono::nanoseconds bounce = std::chrono::milliseconds(300);
  /// A device that is not there, or was unplugged, is looked for again when its folder changes; and, should
  /// that not be told, after so long, twice, four times as long, …
  std::chrono::milliseconds first_pause{1000};
  std::chrono::milliseconds longest_pause{30'000};
};

/// Opens the device once and lets go of it. Throws kiroku::Error where it is not there or has no such key,
/// kiroku::IoError with EACCES where this user may not read it.
void try_footswitch(const FootswitchOptions& options);

/// One input device as the kernel shows it.
struct InputDevice {
  std::filesystem::path node;  // /dev/input/event7
  /// Where it is plugged in, with which of its parts this is: "usb-0000:00:14.0-2/input0"; may be empty.
  std::string place;
  bool has_key = false;  // the footswitch's
  std::string unique;    // its serial number, or its own address where it comes by radio; mostly empty
};
/// Which of the devices of one name is meant: the first that has the key, of one thing that is plugged in;
/// the first of all where none has it. Throws kiroku::Error where several things have the name and the key:
/// nobody can tell whose room a press is for.
std::filesystem::path choose_by_name(const std::string& name, const std::vector<InputDevice>& devices);

/// How it is; the sentence is for people.
struct FootswitchStatus {
  std::string device;
  bool well = false;
  std::string state;  // "is there; 3 presses"
  std::uint64_t presses = 0;
};

/// Waits for presses, from a thread of its own. Every function may be called from any thread.
class Footswitch {
 public:
  /// Called for each press from the footswitch's thread. A press that was made while another was acted on
  /// does nothing, and is told; marks wait their turn. `ago`: how long before this call it was pressed; 0
  /// where the device does not say. What it throws is told.
  using Pressed = std::function<void(std::chrono::nanoseconds ago)>;
  /// Hears when the device is lost, cannot be opened, or is there again.
  using Tell = std::function<void(const std::string& sentence)>;

  /// `time`, by which presses are told from contacts that bounce, must outlive it. How long a device is not
  /// looked for is real time: it waits for what the kernel tells, too.
  Footswitch(FootswitchOptions options, Pressed pressed, Tell tell, const Clock& time = Clock::system());
  /// Waits for a press that is being acted on.
  ~Footswitch();
  Footswitch(const Footswitch&) = delete;
  Footswitch& operator=(const Footswitch&) = delete;

  [[nodiscard]] FootswitchStatus status() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder

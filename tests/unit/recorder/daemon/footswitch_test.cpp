// A pipe stands for the device: it gives the same records, and is lost the same way. What only a real input
// device can be asked (its name, its keys) is not tested.
#include "recorder/daemon/footswitch.h"

#include <algorithm>
#include <atomic>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <future>
#include <linux/input.h>
#include <mutex>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "recorder/daemon/daemon.h"
#include "tests/support/eventually.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/moved_clock.h"
#include "tests/support/recording.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::SizeIs;

constexpr std::uint16_t kKey = KEY_F13;

/// A device that is plugged in and unplugged.
class Pedal {
 public:
  explicit Pedal(std::filesystem::path path) : path_(std::move(path)) {}
  ~Pedal() { unplug(); }
  Pedal(const Pedal&) = delete;
  Pedal& operator=(const Pedal&) = delete;

  void plug_in() {
    ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
    // Both ways, so that opening does not wait for a reader.
    descriptor_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
    ASSERT_GE(descriptor_, 0);
  }
  void unplug() {
    std::filesystem::remove(path_);
    if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  }
  void send(std::uint16_t type, std::uint16_t code, std::int32_t value) const {
    input_event event{};
    event.type = type;
    event.code = code;
    event.value = value;
    if (tells_time) {
      timespec now{};
      ::clock_gettime(CLOCK_REALTIME, &now);
      event.input_event_sec = now.tv_sec - earlier.count();
      event.input_event_usec = now.tv_nsec / 1000;
    }
    ASSERT_EQ(::write(descriptor_, &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }
  void press(std::uint16_t key = kKey) const {
    send(EV_MSC, MSC_SCAN, 5);
    send(EV_KEY, key, 1);
    send(EV_SYN, SYN_REPORT, 0);
    send(EV_KEY, key, 2);
    send(EV_KEY, key, 0);
    send(EV_SYN, SYN_REPORT, 0);
  }
  /// Whether the reader took all that was sent.
  [[nodiscard]] bool was_read() const {
    int left = 0;
    return ::ioctl(descriptor_, FIONREAD, &left) == 0 && left == 0;
  }
  [[nodiscard]] std::string path() const { return path_.string(); }

  bool tells_time = false;          // when it was pressed, as a real device does
  std::chrono::seconds earlier{0};  // than it is read: the recorder was kept from running

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

class FootswitchTest : public testing::Test {
 protected:
  [[nodiscard]] FootswitchOptions options(PressAction action = PressAction::kStartStop) const {
    FootswitchOptions options;
    options.device = pedal.path();
    options.key = kKey;
    options.action = action;
    options.bounce = 0ns;
    options.first_pause = 20ms;
    options.longest_pause = 50ms;
    return options;
  }
  void tell(const std::string& sentence) {
    const std::lock_guard guard(mutex);
    told.push_back(sentence);
  }
  const test::TemporaryFolder folder;
  Pedal pedal{folder / "event7"};
  std::mutex mutex;
  std::vector<std::string> told;
};

// Two equal footswitches of two rooms were one: each press was both rooms'.
TEST(InputDevices, OneOfANameIsChosenAndNoneOfSeveral) {
  const InputDevice keys{"/dev/input/event3", "usb-0000:00:14.0-1/input0", true, ""};
  const InputDevice mouse{"/dev/input/event2", "usb-0000:00:14.0-1/input1", false, ""};
  const InputDevice more_keys{"/dev/input/event4", "usb-0000:00:14.0-1/input2", true, ""};
  const InputDevice other{"/dev/input/event9", "usb-0000:00:14.0-2/input0", true, ""};
  const InputDevice other_mouse{"/dev/input/event10", "usb-0000:00:14.0-2/input1", false, ""};
  EXPECT_EQ(choose_by_name("P", {mouse, keys}), keys.node) << "not the part without the key";
  EXPECT_EQ(choose_by_name("P", {keys, more_keys}), keys.node) << "parts of one thing";
  EXPECT_EQ(choose_by_name("P", {mouse}), mouse.node) << "which is refused later, for its key";
  EXPECT_EQ(choose_by_name("P", {keys, other_mouse}), keys.node);
  EXPECT_THAT(
      [&] {
        (void)choose_by_name("P", {keys, mouse, other});
      },
      testing::ThrowsMessage<Error>(testing::AllOf(
          HasSubstr("several footswitches are named 'P' (/dev/input/event3, /dev/input/event9)"),
          HasSubstr("/dev/input/by-path"))));
  const InputDevice nowhere{"/dev/input/event5", "", true, ""},
      nowhere_too{"/dev/input/event6", "", true, ""};
  EXPECT_THROW((void)choose_by_name("P", {nowhere, nowhere_too}), Error);
  // By radio both are where the receiver is.
  const InputDevice near{"/dev/input/event7", "00:1a:7d:da:71:13", true, "aa:00:00:00:00:01"};
  const InputDevice far{"/dev/input/event8", "00:1a:7d:da:71:13", true, "aa:00:00:00:00:02"};
  EXPECT_THROW((void)choose_by_name("P", {near, far}), Error);
}

TEST_F(FootswitchTest, CountsPressesOfItsKeyAlone) {
  pedal.plug_in();
  std::atomic<int> presses = 0;
  const Footswitch footswitch(options(), [&](std::chrono::nanoseconds /*ago*/) { ++presses; }, {});
  pedal.press();
  pedal.press(KEY_A);
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return presses == 2; }));
  EXPECT_TRUE(footswitch.status().well);
  EXPECT_EQ(footswitch.status().state, "is there; 2 presses");
}

TEST_F(FootswitchTest, ContactsThatBounceAreOnePress) {
  pedal.plug_in();
  FootswitchOptions bouncing = options();
  bouncing.bounce = 300ms;
  test::MovedClock time;
  std::atomic<int> presses = 0;
  const Footswitch footswitch(
      bouncing, [&](std::chrono::nanoseconds /*ago*/) { ++presses; }, {}, time);
  for (int i = 0; i < 5; ++i) pedal.press();
  ASSERT_TRUE(test::eventually([&] { return presses == 1; }));
  // The presses of a pedal come in order: when the next counts, all before it were looked at.
  ASSERT_TRUE(test::eventually([&] { return pedal.was_read(); }));
  time.move(299ms);
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return pedal.was_read(); }));
  time.move(1ms);
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return presses == 2; }));
}

// A case may take seconds to begin. Whoever presses again because nothing seems to happen does not want it
// ended.
TEST_F(FootswitchTest, APressWhileTheOneBeforeIsActedOnDoesNothing) {
  pedal.tells_time = true;
  pedal.plug_in();
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  std::atomic<int> acted = 0;
  const auto act = [&](std::chrono::nanoseconds /*ago*/) {
    ++acted;
    released.wait();
  };
  const Footswitch footswitch(options(), act, [this](const std::string& said) { tell(said); });
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return acted == 1; }));
  pedal.press();
  pedal.press();
  release.set_value();
  EXPECT_TRUE(test::eventually([&] { return footswitch.status().presses == 3; }, 10s));
  EXPECT_TRUE(test::eventually(
      [&] {
        const std::lock_guard guard(mutex);
        return std::ranges::count_if(told, [](const std::string& said) {
                 return said.find("was still being acted on") != std::string::npos;
               }) == 2;
      },
      10s));
  EXPECT_EQ(acted, 1);
  pedal.press();
  EXPECT_TRUE(test::eventually([&] { return acted == 2; })) << "the next one counts";
}

TEST_F(FootswitchTest, MarksWaitTheirTurn) {
  pedal.tells_time = true;
  pedal.plug_in();
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  std::atomic<int> acted = 0;
  const Footswitch footswitch(options(PressAction::kMark),
                              [&](std::chrono::nanoseconds /*ago*/) {
                                ++acted;
                                released.wait();
                              },
                              {});
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return acted == 1; }));
  pedal.press();
  release.set_value();
  EXPECT_TRUE(test::eventually([&] { return acted == 2; }));
}

TEST_F(FootswitchTest, IsLookedForUntilItIsThereAndAgainWhenItIsLost) {
  std::atomic<int> presses = 0;
  const Footswitch footswitch(
      options(), [&](std::chrono::nanoseconds /*ago*/) { ++presses; },
      [this](const std::string& said) { tell(said); });
  ASSERT_TRUE(test::eventually([&] { return footswitch.status().state.starts_with("cannot open"); }));
  for (int i = 0; i < 3; ++i) {
    pedal.plug_in();
    ASSERT_TRUE(test::eventually([&] { return footswitch.status().well; }));
    pedal.press();
    ASSERT_TRUE(test::eventually([&] { return presses == i + 1; }));
    pedal.unplug();
    ASSERT_TRUE(test::eventually([&] { return !footswitch.status().well; }));
  }
  EXPECT_THAT(footswitch.status().state, HasSubstr("event7"));
  const std::lock_guard guard(mutex);
  ASSERT_GE(told.size(), 3U);
  EXPECT_THAT(told[0], HasSubstr("No such file or directory; it is looked for again"));
  EXPECT_THAT(told[1], HasSubstr("event7 is there"));
  EXPECT_THAT(told[2], HasSubstr("not there any more; it is looked for again"));
}

// By what the folder says, long before it would be looked for again.
TEST_F(FootswitchTest, IsThereAsSoonAsItIsPluggedIn) {
  FootswitchOptions patient = options();
  patient.device = (folder / "by-id" / "pedal").string();
  patient.first_pause = patient.longest_pause = 1h;
  std::atomic<int> presses = 0;
  const Footswitch footswitch(patient, [&](std::chrono::nanoseconds /*ago*/) { ++presses; }, {});
  ASSERT_TRUE(test::eventually([&] { return footswitch.status().state.starts_with("cannot open"); }));
  // As udev does it: the device, then a folder of names, then the name.
  for (int i = 0; i < 3; ++i) {
    pedal.plug_in();
    std::filesystem::create_directory(folder / "by-id");
    std::filesystem::create_symlink(pedal.path(), patient.device);
    ASSERT_TRUE(test::eventually([&] { return footswitch.status().well; }));
    pedal.press();
    ASSERT_TRUE(test::eventually([&] { return presses == i + 1; }));
    std::filesystem::remove_all(folder / "by-id");
    pedal.unplug();
    ASSERT_TRUE(test::eventually([&] { return !footswitch.status().well; }));
  }
}

TEST_F(FootswitchTest, APressThatCannotBeActedOnIsTold) {
  pedal.plug_in();
  const Footswitch footswitch(
      options(), [](std::chrono::nanoseconds /*ago*/) { throw UsageError("room or-1 is not recording"); },
      [this](const std::string& said) { tell(said); });
  pedal.press();
  ASSERT_TRUE(test::eventually([&] {
    const std::lock_guard guard(mutex);
    return !told.empty();
  }));
  EXPECT_EQ(told[0], "a press of the footswitch did nothing: room or-1 is not recording");
}

TEST_F(FootswitchTest, APressAfterAnErrorEndsTheOperationAndTheNextBeginsOne) {
  const test::RecorderBench bench;
  test::FaultFileSystem faults(bench.options().archive);
  pedal.plug_in();
  RoomPlan plan;
  plan.name = "or-1";
  plan.session = bench.options();
  plan.session.files = &faults;
  plan.session.video.push_back(bench.stream("camera", "synthetic:pattern?size=64x48&rate=20"));
  plan.rules.resume_within = 10min;
  plan.footswitches = {options()};
  DaemonOptions asked;
  test::MovedClock time;
  asked.time = &time;
  asked.rooms.push_back(std::move(plan));
  asked.archive = bench.options().archive;
  Daemon daemon(std::move(asked));
  const auto room = [&] { return daemon.handle({{"do", "status"}})["rooms"][0]; };
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return room()["state"] == "recording"; }));
  faults.fail("sync", EIO);
  ASSERT_TRUE(test::eventually([&] { return room()["state"] == "idle" && room()["tries_again"] == true; }));
  EXPECT_TRUE(daemon.recording()) << "no upgrade may end the recorder now: it would not go on with it";
  faults.heal();
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return room()["tries_again"] == false; }));
  EXPECT_FALSE(daemon.recording());
  EXPECT_EQ(room()["state"], "idle");
  pedal.press();
  EXPECT_TRUE(test::eventually([&] { return room()["state"] == "recording"; }));
}

// Between two operations: the mark is of the last one, and so is the end of it.
TEST_F(FootswitchTest, APressIsOfNoCaseThatBeganAfterIt) {
  const test::RecorderBench bench;
  Pedal marker(folder / "event8");
  pedal.tells_time = marker.tells_time = true;
  pedal.plug_in();
  marker.plug_in();
  RoomPlan plan;
  plan.name = "or-1";
  plan.session = bench.options();
  plan.session.video.push_back(bench.stream("camera", "synthetic:pattern?size=64x48&rate=20"));
  plan.footswitches = {options(PressAction::kStop), options(PressAction::kMark)};
  plan.footswitches[1].device = marker.path();
  test::MovedClock time;
  DaemonOptions asked;
  asked.time = &time;
  asked.rooms.push_back(std::move(plan));
  asked.archive = bench.options().archive;
  asked.listener.warn = [&](const std::string& sentence) { tell(sentence); };
  Daemon daemon(std::move(asked));
  const auto room = [&] { return daemon.handle({{"do", "status"}})["rooms"][0]; };
  const auto refused = [&] {
    const std::lock_guard guard(mutex);
    return std::ranges::count_if(told, [](const std::string& sentence) {
      return sentence.find("it was pressed before case") != std::string::npos;
    });
  };
  const std::string id = daemon.handle({{"do", "start"}})["case"];
  time.move(60s);
  pedal.earlier = marker.earlier = 3600s;
  marker.press();
  ASSERT_TRUE(test::eventually([&] { return refused() == 1; }));
  pedal.press();
  ASSERT_TRUE(test::eventually([&] { return refused() == 2; }));
  EXPECT_EQ(room()["state"], "recording");
  marker.earlier = 10s;
  marker.press();
  ASSERT_TRUE(
      test::eventually([&] { return marker.was_read() && room()["footswitches"][1]["presses"] == 2; }));
  daemon.handle({{"do", "stop"}});
  EXPECT_THAT(bench.read(bench.options().archive / id).all<archive::MarkEntry>(), SizeIs(1));
  EXPECT_EQ(refused(), 2);
}

TEST_F(FootswitchTest, StartsMarksAndStopsARoom) {
  const test::RecorderBench bench;
  Pedal marker(folder / "event8");
  pedal.plug_in();
  marker.plug_in();
  std::vector<SessionResult> closed;
  {
    RoomPlan plan;
    plan.name = "or-1";
    plan.session = bench.options();
    plan.session.video.push_back(bench.stream("camera", "synthetic:pattern?size=64x48&rate=20"));
    plan.footswitches = {options(), options(PressAction::kMark)};
    plan.footswitches[1].device = marker.path();
    plan.footswitches[1].mark = "left pedal";
    DaemonOptions asked;
    asked.rooms.push_back(std::move(plan));
    asked.archive = bench.options().archive;
    asked.listener.closed = [&](const SessionResult& result) { closed.push_back(result); };
    Daemon daemon(std::move(asked));
    const auto room = [&] { return daemon.handle({{"do", "status"}})["rooms"][0]; };
    EXPECT_THAT(room()["footswitches"], SizeIs(2));
    pedal.press();
    ASSERT_TRUE(test::eventually([&] { return room()["state"] == "recording"; }));
    EXPECT_EQ(room()["reason"], "footswitch");
    marker.press();
    ASSERT_TRUE(test::eventually([&] { return room()["footswitches"][1]["presses"] == 1; }));
    ASSERT_TRUE(test::eventually([&] { return room()["streams"][0]["frames"] >= 5; }));
    pedal.press();
    ASSERT_TRUE(test::eventually([&] { return room()["state"] == "idle"; }));
  }
  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_EQ(closed[0].close_reason, "footswitch");
  const auto recorded = bench.read(closed[0].folder);
  ASSERT_THAT(recorded.lines("events"), SizeIs(1));
  EXPECT_THAT(recorded.lines("events")[0], HasSubstr("left pedal"));
}

}  // namespace
}  // namespace kiroku::recorder

#include "apps/kiroku/kept_log.h"

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <fcntl.h>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string_view>
#include <sys/file.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/witness_judgement.h"
#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/storage/file_system.h"
#include "archive/writing/log_reading.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Throws kiroku::Error where what is kept is no checkpoint of the home's log.
std::optional<crypto::Checkpoint> kept_checkpoint(const Home& home) {
  std::error_code failed;
  const fs::file_type there = fs::symlink_status(home.newest_log_note(), failed).type();
  if (there == fs::file_type::not_found) return std::nullopt;
  if (there != fs::file_type::regular) throw Error("it is no file");  // a pipe would be waited for
  const archive::OutsideNote note = load_outside_note(home.newest_log_note());
  if (is_of_log(note, home.device())) {
    if (const auto stated = crypto::Checkpoint::parse(crypto::open_note(note.text, {home.device()}).text))
      return stated;
  }
  throw Error("it is no checkpoint of this home's log");
}

/// What the log in the archive lacks of it; "" where it goes on from it. Reads it all: files in checkpoints/
/// alone say nothing of its lines.
std::string what_lacks(const Home& home, const crypto::Checkpoint& kept) {
  const fs::path log = home.log_folder();
  std::error_code ignored;
  if (!fs::exists(log / archive::kLedgerFile, ignored)) return "there is none";
  std::uint64_t entries = 0;
  crypto::MerkleFrontier tree;
  std::string damage = archive::for_each_readable_log_line(log, [&](const archive::LogLine& line) {
    ++entries;
    if (tree.size() < kept.size) tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
  });
  if (tree.size() == kept.size && tree.root() == kept.root) return "";
  if (!damage.empty()) return damage;
  return entries < kept.size ? "it has " + std::to_string(entries) + " entries" : "its entries are others";
}

std::string words_of(const Home& home, const crypto::Checkpoint& kept, const std::string& lacks) {
  return "the appliance log in " + home.log_folder().string() +
         " is not the one that this home wrote last, which was signed over " + std::to_string(kept.size) +
         " entries: " + lacks +
         ". Holds and consents that stand in the other one are not known, and nothing is erased. See "
         "whether the archive's disk is mounted, or put the log back; where it is lost for good, remove " +
         home.newest_log_note().string() + ", and this one counts from the next start on";
}

std::string words_of(const Home& home, const std::exception& why) {
  const std::string file = home.newest_log_note().string();
  return "nobody can tell whether the appliance log in " + home.log_folder().string() +
         " is the one that this home wrote last: " + file + " cannot be compared with it: " + why.what() +
         ". Nothing is erased. Where 'kiroku log --verify' finds the log whole, remove that file";
}

/// Does something with the newest text that it is given, on a thread of its own. The last one is done before
/// it is destroyed.
class NewestDone {
 public:
  /// `what` must not throw.
  explicit NewestDone(std::function<void(const std::string& text)> what)
      : do_(std::move(what)), thread_([this] { work(); }) {}
  ~NewestDone() {
    {
      const std::lock_guard guard(mutex_);
      ended_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  NewestDone(const NewestDone&) = delete;
  NewestDone& operator=(const NewestDone&) = delete;

  /// Waits so long at most until it is done; not at all while what was given before is not done yet.
  void give(std::string_view text, std::chrono::milliseconds patience = {}) {
    std::unique_lock lock(mutex_);
    const bool is_behind = done_ < count_;
    text_ = std::string(text);
    const std::uint64_t number = ++count_;
    changed_.notify_all();
    if (is_behind || patience.count() == 0) return;
    changed_.wait_for(lock, patience, [&] { return done_ >= number; });
  }

 private:
  void work() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return text_ || ended_; });
      if (!text_) return;
      const std::string text = *std::exchange(text_, std::nullopt);
      const std::uint64_t number = count_;
      lock.unlock();
      do_(text);
      lock.lock();
      done_ = number;
      changed_.notify_all();
    }
  }

  const std::function<void(const std::string& text)> do_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::string> text_;
  std::uint64_t count_ = 0, done_ = 0;  // of those given
  bool ended_ = false;
  std::thread thread_;  // last: uses the rest
};

/// Of the home's processes one at a time, until it is destroyed: they compare what is kept, and replace it.
/// By the lock of a file that each home has, and nobody else locks. Throws kiroku::Error where another one
/// has it for long.
Descriptor turn_to_keep(const Home& home) {
  constexpr std::chrono::seconds kPatience{5};
  constexpr std::chrono::milliseconds kPause{5};
  const fs::path file = home.device_file();
  Descriptor turn(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!turn) throw IoError("open", file, errno);
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (::flock(turn.number(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) throw IoError("lock", file, errno);
    if (std::chrono::steady_clock::now() >= deadline)
      throw Error("another process holds " + file.string() + " locked");
    std::this_thread::sleep_for(kPause);
  }
  return turn;
}

/// Keeps the newest of the checkpoints that it is given: a home whose disk is slow holds up no room's entry.
class NoteKeeper {
 public:
  explicit NoteKeeper(const Home& home) : home_(Home::open(home.folder().string())) {}

  void give(std::string_view note) { kept_.give(note); }

 private:
  void keep(const std::string& note) {
    try {
      const fs::path file = home_.newest_log_note();
      // Whoever writes to the archive can put anything into the newest one's place, and an older log in the
      // log's.
      if (!is_of_log({file.string(), note}, home_.device())) return;
      const auto stated = crypto::Checkpoint::parse(crypto::open_note(note, {home_.device()}).text);
      const Descriptor turn = turn_to_keep(home_);
      const auto kept = kept_checkpoint(home_);
      if (stated && (!kept || kept->size < stated->size))
        archive::real_file_system().write_durably(file, bytes_of(note));
      is_told_ = false;
    } catch (const std::exception& error) {
      if (!std::exchange(is_told_, true))
        print_error("kiroku", "warning: the log's newest checkpoint is not kept in " +
                                  home_.newest_log_note().string() + ": " + error.what());
    }
  }

  const Home home_;
  bool is_told_ = false;                                              // the thread's alone
  NewestDone kept_{[this](const std::string& note) { keep(note); }};  // last: uses the rest
};

Descriptor open_for_others(const fs::path& file) {
  return Descriptor(::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0644));
}

std::optional<std::string> remembered_in(const fs::path& file) {
  try {
    const archive::FileReading& files = archive::real_reading();
    if (!files.exists(file)) return std::nullopt;
    return archive::read_small(files.open_to_read(file), archive::kMaximumNoteBytes);
  } catch (const Error&) {
    return std::nullopt;
  }
}

/// How many entries of its log the device signed there; 0: it is no such note.
std::uint64_t size_of_own(const std::string& note, const crypto::VerifierKey& device) {
  const auto stated = crypto::Checkpoint::parse(crypto::open_note(note, {device}).text);
  return stated && stated->origin == archive::log_origin(device.name()) ? stated->size : 0;
}

/// Of the home's processes one at a time. Whoever may read the file can lock it, and holds nobody up for
/// long.
void wait_for_turn(const Descriptor& file) {
  constexpr std::chrono::seconds kPatience{1};
  constexpr std::chrono::milliseconds kPause{1};
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (::flock(file.number(), LOCK_EX | LOCK_NB) != 0) {
    // Where the file system knows no locks nobody else has one.
    const bool is_taken = errno == EWOULDBLOCK || errno == EINTR;
    if (!is_taken || std::chrono::steady_clock::now() >= deadline) return;
    std::this_thread::sleep_for(kPause);
  }
}

/// As it stands, and without a flush: other processes see it at once, and what a power cut takes of it the
/// note in the archive tells. Not where `is_newer` says so of what another process wrote meanwhile.
void write_for_others(const fs::path& file, const std::string& text,
                      const std::function<bool(const std::string& there)>& is_newer) {
  Descriptor opened = open_for_others(file);
  if (!opened && errno == EACCES && ::unlink(file.c_str()) == 0) {
    // Root ran a command.
    opened = open_for_others(file);
  }
  if (!opened) return;
  wait_for_turn(opened);
  if (const auto there = remembered_in(file); there && is_newer(*there)) return;
  std::string_view rest = text;
  while (!rest.empty()) {
    const ssize_t count =
        ::pwrite(opened.number(), rest.data(), rest.size(), static_cast<off_t>(text.size() - rest.size()));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    rest.remove_prefix(static_cast<std::size_t>(count));
  }
  while (::ftruncate(opened.number(), static_cast<off_t>(text.size())) != 0 && errno == EINTR) {
  }
}

/// What the processes of this home signed last. Where it cannot be written or read nothing is remembered: it
/// keeps nobody from recording.
archive::LogMemory memory_of(const Home& home) {
  static constexpr std::chrono::milliseconds kMoment{250};
  const fs::path file = home.folder() / "last-signed.note";
  const crypto::VerifierKey device = home.device();
  // Whoever waits for a slow disk no longer has the log's turn. What was there when the log was opened may be
  // of another log, which had more entries.
  const std::string at_first = remembered_in(file).value_or("");
  const auto written = std::make_shared<NewestDone>([=](const std::string& note) {
    write_for_others(file, note, [&](const std::string& there) {
      return there != at_first && size_of_own(there, device) > size_of_own(note, device);
    });
  });
  return {.newest = [file] { return remembered_in(file); },
          .keep = [written](std::string_view note) { written->give(note, kMoment); }};
}

}  // namespace

std::string why_another_log(const Home& home) {
  try {
    const auto kept = kept_checkpoint(home);
    if (!kept || kept->size == 0) return "";
    const std::string lacks = what_lacks(home, *kept);
    return lacks.empty() ? "" : words_of(home, *kept, lacks);
  } catch (const std::exception& error) {
    return words_of(home, error);
  }
}

void require_same_log(const Home& home) {
  if (const std::string why = why_another_log(home); !why.empty())
    throw Error("nobody can tell what is held and consented to: " + why);
}

std::optional<archive::OutsideNote> home_newest_note(const Home& home) {
  try {
    if (kept_checkpoint(home)) return load_outside_note(home.newest_log_note());
  } catch (const Error& error) {
    print_error("kiroku", "warning: the log was not compared with " + home.newest_log_note().string() + ": " +
                              error.what());
  }
  return std::nullopt;
}

OpenedLog open_kept_log(const Home& home, const crypto::SigningKey& key) {
  OpenedLog opened;
  std::optional<crypto::Checkpoint> kept;
  try {
    kept = kept_checkpoint(home);
  } catch (const std::exception& error) {
    opened.why_another = words_of(home, error);
  }
  std::error_code unknown;
  const bool is_new = !fs::exists(home.log_folder() / archive::kLedgerFile, unknown);
  opened.log = archive::ApplianceLog::open(archive::real_file_system(), home.log_folder(), key,
                                           home.device().name(), kept, memory_of(home));
  if (const std::string lacks = opened.log->lacks(); kept && !lacks.empty())
    opened.why_another = words_of(home, *kept, is_new ? "there is none" : lacks);
  if (opened.why_another.empty()) {
    opened.log->keep_notes(
        [keeper = std::make_shared<NoteKeeper>(home)](std::string_view note) { keeper->give(note); });
  }
  return opened;
}

std::unique_ptr<archive::ApplianceLog> open_log(const Home& home, const crypto::SigningKey& key) {
  auto log = open_kept_log(home, key).log;
  if (const std::string damage = log->damage(); !damage.empty()) print_error("kiroku", "warning: " + damage);
  for (const std::string& remark : log->remarks()) print_error("kiroku", "warning: " + remark);
  return log;
}

}  // namespace kiroku::apps

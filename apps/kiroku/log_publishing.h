// The appliance log of a home as a tree that others can follow (witness/tiles.h).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "base/clock.h"
#include "crypto/signed_note.h"
#include "witness/following.h"

namespace kiroku::apps {

/// Brings what is published in `folder` up to date. Nothing is written that does not go on from there.
/// `progress` is told how many leaf hashes were looked at. Throws as witness::follow_log() and
/// witness::read_log_to_show() do.
struct Publication {
  witness::Followed came;
  std::vector<std::string> rest;  // what the log has beyond what is published, a sentence each
  bool is_rest_unsigned = false;  // more than a recorder leaves that writes just now, or was stopped
};
Publication publish_log(const Home& home, const std::filesystem::path& folder,
                        const std::function<void(std::uint64_t)>& progress = {});

/// What came of it, a sentence.
std::string published_text(const witness::Followed& followed, const std::string& folder);

/// What is published of a home's log, brought up to date by a program that goes on. Not thread-safe.
class LogPublishing {
 public:
  /// Each publishing leaves locked objects in a store.
  static constexpr std::chrono::hours kInterval{1};
  /// Where nothing could be published, as after a full disk: each try reads the whole log, that of years.
  static constexpr std::chrono::seconds kPause{60};

  /// In home.published_log(), where it is `wanted`. `home` and `time` must outlive it.
  LogPublishing(const Home& home, bool wanted, const Clock& time = Clock::system())
      : home_(home), wanted_(wanted), time_(time) {}

  /// At most as often as these say. What is wrong with the log is added to `problems` each time, and keeps
  /// nothing else from going on. Throws nothing for it.
  void bring_up_to_date(std::vector<std::string>& problems);

 private:
  const Home& home_;
  const bool wanted_;
  const Clock& time_;
  std::optional<Clock::Time> next_;
  std::string problem_;
};

/// "1 entry"; of none "0 entries".
std::string entries_text(const std::optional<crypto::Checkpoint>& checkpoint);

}  // namespace kiroku::apps

#include "archive/upkeep/holds.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <fcntl.h>
#include <map>
#include <optional>
#include <string_view>
#include <sys/file.h>
#include <thread>
#include <utility>

#include "archive/format/log_entry.h"
#include "archive/upkeep/stated_log.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

Holds read_holds(const fs::path& log_folder, const crypto::VerifierKey& device,
                 const std::optional<crypto::Checkpoint>& seen) {
  constexpr std::array<std::string_view, 2> kTypes{"case-held", "case-released"};
  std::map<std::string, std::map<std::uint64_t, Hold>> standing;  // by case, then by entry
  read_stated(log_folder, device, seen,
              {"which cases are under legal hold", kTypes, [&](const StatedEntry& stated) {
                 const LogEntryBody& body = stated.entry.body;
                 if (const auto* held = std::get_if<CaseHeldEntry>(&body)) {
                   standing[held->case_id].try_emplace(
                       stated.number, Hold{stated.number, stated.entry.at.utc, held->reason, held->who});
                 } else if (const auto* released = std::get_if<CaseReleasedEntry>(&body)) {
                   const auto of_case = standing.find(released->case_id);
                   if (of_case == standing.end() || !of_case->second.contains(released->hold) ||
                       !stated.is_signed()) {
                     return;
                   }
                   of_case->second.erase(released->hold);
                 }
               }});
  Holds holds;
  for (auto& [case_id, of_case] : standing) {
    std::vector<Hold>& of_this = holds[case_id];
    for (auto& [entry, hold] : of_case) of_this.push_back(std::move(hold));
  }
  return holds;
}

std::string why_held(const Holds& holds, const std::string& case_id) {
  const auto found = holds.find(case_id);
  if (found == holds.end() || found->second.empty()) {
    return "";
  }
  const Hold& first = found->second.front();
  const std::size_t more = found->second.size() - 1;
  return "it is under legal hold since " + format_utc(first.since) + " (entry " +
         std::to_string(first.entry) + " of the appliance log, by " + printable(first.who) +
         "): " + printable(first.reason) +
         (more == 0 ? ""
                    : "; " + std::to_string(more) + (more == 1 ? " more hold stands" : " more holds stand"));
}

ErasingTurn::ErasingTurn(const fs::path& archive)
    : folder_(::open(archive.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (!folder_) {
    throw IoError("open", archive, errno);
  }
  // An erasure asks authorities while it has its turn.
  constexpr std::chrono::minutes kPatience{5};
  constexpr std::chrono::milliseconds kPause{20};
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (::flock(folder_.number(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) {
      throw IoError("lock", archive, errno);
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      throw Error(
          "another process has held " + archive.string() +
          " locked for 5 minutes: nothing is erased, held or released meanwhile. Whoever may read that "
          "folder can lock it; 'lslocks' as root names the process: end it");
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace kiroku::archive

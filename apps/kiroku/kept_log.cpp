#include "apps/kiroku/kept_log.h"

#include <filesystem>
#include <utility>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/witness_judgement.h"
#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/verify/found_files.h"
#include "base/error.h"

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

/// What the log in the archive lacks of it; "" where it goes on from it.
std::string what_lacks(const Home& home, const crypto::Checkpoint& kept) {
  const fs::path log = home.log_folder();
  std::error_code ignored;
  if (!fs::exists(log / archive::kLedgerFile, ignored)) return "there is none";
  // The log's own note of that size spares reading the entries of years at each start.
  const bool goes_on = archive::newest_note(log) >= kept.size &&
                       archive::is_signed_entry(log, home.device(), kept.size - 1, kept.root);
  if (goes_on) return "";
  std::uint64_t entries = 0;
  if (const std::string damage =
          archive::for_each_readable_log_line(log, [&](const archive::LogLine& /*line*/) { ++entries; });
      !damage.empty())
    return damage;
  if (entries < kept.size) return "it has " + std::to_string(entries) + " entries";
  return archive::root_of_log(log, kept.size) == kept.root ? "" : "its entries are others";
}

void keep_durably(const fs::path& file, std::string_view note) {
  archive::FileSystem& files = archive::real_file_system();
  std::error_code ignored;
  if (fs::is_regular_file(fs::symlink_status(file, ignored)) &&
      text_of(read_small_file(file, "the newest checkpoint")) == note)
    return;
  // Another process that keeps one has the log's turn, as this one has.
  const fs::path beside = file.string() + ".new";
  if (files.exists(beside)) files.remove(beside);
  files.write_durably(beside, bytes_of(note));
  files.rename(beside, file);
  files.sync_folder(file.parent_path());
}

}  // namespace

std::string why_another_log(const Home& home) {
  const std::string file = home.newest_log_note().string();
  try {
    const auto kept = kept_checkpoint(home);
    if (!kept || kept->size == 0) return "";
    const std::string lacks = what_lacks(home, *kept);
    if (lacks.empty()) return "";
    return "the appliance log in " + home.log_folder().string() +
           " is not the one that this home wrote last, which was signed over " + std::to_string(kept->size) +
           " entries: " + lacks +
           ". Holds and consents that stand in the other one are not known, and nothing is erased. See "
           "whether the archive's disk is mounted, or put the log back; where it is lost for good, remove " +
           file + ", and this one counts from the next start on";
  } catch (const std::exception& error) {
    return "nobody can tell whether the appliance log in " + home.log_folder().string() +
           " is the one that this home wrote last: " + file + " cannot be compared with it: " + error.what() +
           ". Nothing is erased. Where 'kiroku log --verify' finds the log whole, remove that file";
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

std::unique_ptr<archive::ApplianceLog> open_kept_log(const Home& home, const crypto::SigningKey& key) {
  const bool is_another = !why_another_log(home).empty();
  auto log =
      archive::ApplianceLog::open(archive::real_file_system(), home.log_folder(), key, home.device().name());
  if (is_another) return log;
  log->keep_notes([file = home.newest_log_note(), device = home.device(),
                   is_told = false](std::string_view note) mutable {
    try {
      // Whoever writes to the archive can put anything into the newest one's place.
      if (is_of_log({file.string(), std::string(note)}, device)) keep_durably(file, note);
      is_told = false;
    } catch (const std::exception& error) {
      if (!std::exchange(is_told, true))
        print_error("kiroku", "warning: the log's newest checkpoint is not kept in " + file.string() + ": " +
                                  error.what());
    }
  });
  return log;
}

std::unique_ptr<archive::ApplianceLog> open_log(const Home& home, const crypto::SigningKey& key) {
  auto log = open_kept_log(home, key);
  if (const std::string damage = log->damage(); !damage.empty()) print_error("kiroku", "warning: " + damage);
  return log;
}

}  // namespace kiroku::apps

#include "fleet/shipper.h"

#include <algorithm>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"
#include "archive/search/note_writer.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/encoding.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using archive::CaseFolder;
using archive::ListedFile;
using archive::ReadableFile;

/// Most of a ledger that goes away at once.
constexpr std::uint64_t kLargestGrowth = 4U << 20;
constexpr std::size_t kOffsetDigits = 12;
/// A folder that was changed so recently may be changed again without another time: file systems tell time in
/// steps.
constexpr std::chrono::seconds kSettled{2};
/// So many objects are entered into the list at once.
constexpr std::uint64_t kKeptTogether = 64;
/// How long what the store confirmed of a legal hold is taken for granted.
constexpr std::chrono::hours kHoldsLookedAtAgain{24};
constexpr std::string_view kLogFolder = "log";
constexpr std::string_view kPublished = "published";
constexpr std::string_view kPublishedCheckpoint = "checkpoint", kPublishedTiles = "tile";

/// Bytes of a file from `begin` on, as many as it had.
class Stretch final : public crypto::ByteSource {
 public:
  Stretch(const ReadableFile& file, std::uint64_t begin, std::uint64_t bytes)
      : file_(file), begin_(begin), bytes_(bytes) {}
  [[nodiscard]] std::uint64_t size() const override { return bytes_; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    if (offset >= bytes_) return 0;
    return file_.read_at(begin_ + offset, into.first(std::min<std::uint64_t>(into.size(), bytes_ - offset)));
  }

 private:
  const ReadableFile& file_;
  std::uint64_t begin_, bytes_;
};

crypto::Sha256Digest hash_of(const crypto::ByteSource& source) {
  crypto::Sha256 hash;
  Bytes buffer(1U << 18);
  std::uint64_t offset = 0;
  while (const std::size_t read = source.read_at(offset, buffer)) {
    hash.update(ByteView(buffer).first(read));
    offset += read;
  }
  return hash.finish();
}

/// Up to and with the last end of a line.
std::uint64_t whole_lines(const ReadableFile& file, std::uint64_t begin, std::uint64_t end) {
  Bytes buffer(64U << 10);
  while (end > begin) {
    const std::uint64_t from = end - std::min<std::uint64_t>(buffer.size(), end - begin);
    const std::span part = std::span(buffer).first(static_cast<std::size_t>(end - from));
    file.read_wholly_at(from, part);
    for (std::size_t i = part.size(); i > 0; --i) {
      if (part[i - 1] == std::byte{'\n'}) return from + i - begin;
    }
    end = from;
  }
  return 0;
}

std::string growth_key(const std::string& prefix, const std::string& recording, std::uint64_t offset) {
  std::string digits = std::to_string(offset);
  digits.insert(0, kOffsetDigits - std::min(kOffsetDigits, digits.size()), '0');
  return prefix + "growing/" + recording + "/" + digits;
}

/// tile/<level>/x001/x234/067.p/12 has fewer.
constexpr int kMostTileLevels = 8;

/// In this order files go: what lines name, the lines, what was signed of them. So whatever the store holds
/// when the appliance is destroyed is what a recorder that was cut off could have left.
enum class Turn { kNamedByLines, kLedger, kOfLines };
Turn turn_of(const ListedFile& file) {
  if (file.path == archive::kLedgerFile) return Turn::kLedger;
  return file.path.starts_with(std::string(archive::kCheckpointsFolder) + "/") ? Turn::kOfLines
                                                                               : Turn::kNamedByLines;
}

/// Of a checkpoint's note; 0 for any other name.
std::uint64_t lines_of_note(const ListedFile& file) {
  return archive::size_of_note_name(std::string_view(file.path).substr(file.path.rfind('/') + 1)).value_or(0);
}

std::uint64_t lines_in(const crypto::ByteSource& source) {
  Bytes buffer(64U << 10);
  std::uint64_t offset = 0, lines = 0;
  while (const std::size_t read = source.read_at(offset, buffer)) {
    lines += static_cast<std::uint64_t>(
        std::count(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(read), std::byte{'\n'}));
    offset += read;
  }
  return lines;
}

/// Stores keep whole seconds.
bool is_locked(const StoredObject& stored, UtcTime until) {
  return stored.compliance && stored.lock_ends &&
         *stored.lock_ends >= std::chrono::floor<std::chrono::seconds>(until);
}

/// Which entries of the log hold a case; "" where none does.
std::string entries_of(const std::vector<archive::Hold>& holds) {
  std::string entries;
  for (const archive::Hold& each : holds)
    entries += (entries.empty() ? "" : ",") + std::to_string(each.entry);
  return entries;
}

/// How a recording's folder is: its ledger, and when anything in it was made, renamed or removed last. Files
/// are never written again once they have their names.
struct FolderState {
  std::string text;
  UtcTime newest;
};
void take_in(const fs::path& folder, const std::string& name, int levels, FolderState& state) {
  const archive::FileReading& files = archive::real_reading();
  const auto take = [&](const std::string& what, const archive::FileStatus& status) {
    state.text += what + " " + std::to_string(status.last_change.time_since_epoch().count()) + " " +
                  std::to_string(status.bytes) + "\n";
    state.newest = std::max(state.newest, status.last_change);
  };
  const auto of_folder = files.status(folder);
  if (!of_folder) return;
  take(name, *of_folder);
  if (const auto ledger = files.status(folder / archive::kLedgerFile))
    take(name + std::string(archive::kLedgerFile), *ledger);
  if (levels == 0) return;
  for (const std::string& each : files.names_in(folder)) {
    if (files.is_folder(folder / each)) take_in(folder / each, name + each + "/", levels - 1, state);
  }
}
FolderState state_of(const fs::path& folder) {
  constexpr int kLevels = 2;  // segments/<stream>
  FolderState state;
  take_in(folder, "", kLevels, state);
  return state;
}

}  // namespace

/// One look at the whole archive, with or without the store.
struct Shipper::Pass {
  Shipper& shipper;
  const fs::path& archive;
  const std::function<bool()>* is_ended = nullptr;  // null: nothing is sent
  ShippingReport report;
  const archive::Holds* holds = nullptr;  // null: the log cannot be read
  bool log_went = false;                  // whole, as it is now
  bool held = false;                      // what is shipped now is of a case under legal hold
  std::uint64_t left_to_look = shipper.terms_.looked_at_again;
  std::string locks_problem = {};  // why locks could not be looked at

  [[nodiscard]] std::string prefix() const { return shipper.terms_.appliance + "/"; }
  [[nodiscard]] bool ended() const { return is_ended != nullptr && (*is_ended)(); }

  void wait(const FileState& file) {
    ++report.waiting;
    report.waiting_bytes += file.bytes;
    report.waiting_since = std::min(report.waiting_since.value_or(file.changed), file.changed);
  }

  /// Whether the store tells of the object as it must be.
  [[nodiscard]] bool is_as_put(const StoredObject& stored, const ShippedObject& object) const {
    return (!held || stored.legal_hold) && stored.bytes == object.file.bytes &&
           stored.sha256 == object.sha256 && is_locked(stored, object.lock_ends);
  }

  /// An earlier process put it, and could not enter it any more, or the list is another: nothing is put
  /// twice.
  bool take_up(const std::string& key, const StoredObject& there, ShippedObject object) {
    if (there.sha256 != object.sha256 || there.bytes != object.file.bytes || !there.compliance ||
        !there.lock_ends)
      return false;
    if (held) require_hold(key, there.version, true);
    object.version = there.version;
    object.lock_ends = *there.lock_ends;
    shipper.list_.enter(key, object);
    ++report.found;
    return true;
  }

  /// Puts what `source` holds, and asks the store about it before it counts.
  void send(const std::string& key, const crypto::ByteSource& source, const FileState& state) {
    ShippingList& list = shipper.list_;
    const crypto::Sha256Digest hash = hash_of(source);
    ShippedObject object{state, crypto::to_hex(hash), "", shipper.time_.utc() + shipper.terms_.retention};
    // Written anew with the same bytes, as a recorder that goes on with a case may do: the store has them.
    if (std::optional<ShippedObject> known = list.find(key); known && known->sha256 == object.sha256) {
      known->file = state;
      list.enter(key, *known);
      return;
    }
    if (list.may_be_behind()) {
      const std::optional<StoredObject> there = shipper.store_.look(key);
      if (there && take_up(key, *there, object)) return;
    }
    list.before_putting();
    std::optional<StoredObject> stored;
    try {
      object.version = shipper.store_.put(key, source, hash, {object.lock_ends, held});
      stored = shipper.store_.look(key, object.version);
    } catch (const Error&) {
      list.doubt();
      throw;
    }
    if (!stored || !is_as_put(*stored, object)) {
      list.doubt();
      throw Error("the store took " + key + ", and does not hold it as it was put, locked until " +
                  format_utc(object.lock_ends) + (held ? " and under legal hold" : "") +
                  ": its locks cannot be relied on ('kiroku ship --probe' tries them)");
    }
    list.enter(key, object);
    if (++report.sent % kKeptTogether == 0) list.keep();
    report.sent_bytes += state.bytes;
  }

  void file(const CaseFolder& folder, const ListedFile& listed, const std::string& key) {
    archive::FileOpening opening = folder.open_file(listed.path);
    if (!opening.file) {
      // Erased, or renamed, since the folder was listed.
      if (opening.problem == archive::FileProblem::kMissing) return;
      throw Error((folder.path() / listed.path).string() + " " + opening.explanation +
                  ": it was not shipped");
    }
    const auto status = archive::real_reading().status(folder.path() / listed.path);
    if (!status) return;
    const FileState state{opening.file->size(), status->last_change};
    const std::optional<ShippedObject> known = shipper.list_.find(key);
    if (known && known->file == state) return;
    if (is_ended == nullptr) return wait(state);
    send(key, *opening.file, state);
  }

  /// The lines of a ledger that were added since the last look. How many lines of it are in the store then.
  std::uint64_t growth(const ReadableFile& ledger, const std::string& recording) {
    ShippingList::Grown grown = shipper.list_.grown(recording);
    const auto status = archive::real_reading().status(ledger.path());
    while (!ended()) {
      const std::uint64_t end = std::min(ledger.size(), grown.bytes + kLargestGrowth);
      const std::uint64_t bytes = grown.bytes < end ? whole_lines(ledger, grown.bytes, end) : 0;
      if (bytes == 0) break;
      const FileState state{bytes, status ? status->last_change : UtcTime{}};
      if (is_ended == nullptr) {
        wait(state);
        break;
      }
      const std::string key = growth_key(prefix(), recording, grown.bytes);
      if (const std::optional<StoredObject> there = shipper.store_.look(key)) {
        take_up_part(key, *there, ledger, recording, grown);
        continue;
      }
      const Stretch part(ledger, grown.bytes, bytes);
      send(key, part, state);
      grown = {grown.bytes + bytes, grown.lines + lines_in(part)};
      shipper.list_.set_grown(recording, grown);
      // A part that is put again would have other lines by then.
      shipper.list_.keep();
    }
    return grown.lines;
  }

  /// A part that is in the store and not in the list: an earlier process put it. Of anything else a ledger
  /// with two endings would come.
  void take_up_part(const std::string& key, const StoredObject& there, const ReadableFile& ledger,
                    const std::string& recording, ShippingList::Grown& grown) {
    const bool fits = there.bytes > 0 && there.bytes <= ledger.size() - grown.bytes;
    const Stretch part(ledger, grown.bytes, fits ? there.bytes : 0);
    if (!fits || !take_up(key, there, {{there.bytes, {}}, crypto::to_hex(hash_of(part)), "", {}})) {
      throw Error(key + " in the store is no part of " + ledger.path().string() +
                  ": another appliance ships under the same name, or this one was restored from an old copy");
    }
    grown = {grown.bytes + there.bytes, grown.lines + lines_in(part)};
    shipper.list_.set_grown(recording, grown);
  }

  /// Whether the case is to be under legal hold in the store, as far as is known.
  [[nodiscard]] bool is_held(const std::string& case_id) {
    if (holds == nullptr) return shipper.list_.hold(case_id).value_or(false);
    return !archive::why_held(*holds, case_id).empty();
  }

  /// Sets or lifts the hold of a version where the store does not tell of it so, and asks back.
  void require_hold(const std::string& key, const std::string& version, bool standing) {
    ObjectStore& store = shipper.store_;
    const std::optional<StoredObject> before = store.look(key, version);
    if (!before || before->legal_hold == standing) return;
    store.set_legal_hold(key, version, standing);
    const std::optional<StoredObject> after = store.look(key, version);
    if (!after || after->legal_hold != standing) {
      throw Error("the store took the legal hold of " + key + " as " + (standing ? "set" : "lifted") +
                  ", and does not tell of it so");
    }
  }

  /// Every version of a case's objects, whoever put them, those that can be asked for in front; `doing`
  /// completes "its legal hold was not …".
  [[nodiscard]] std::vector<ListedVersion> versions_of(const std::string& case_id, const std::string& doing) {
    const std::string evidence = prefix() + std::string(archive::kEvidenceFolder) + "/" + case_id + ".ers";
    std::vector<ListedVersion> versions;
    for (const std::string& begin :
         {prefix() + case_id + "/", prefix() + "growing/" + case_id + "/", evidence}) {
      shipper.store_.for_each_version(begin, [&](const ListedVersion& each) {
        if (versions.size() == kMostVersions) {
          throw Error("the store lists more than " + std::to_string(kMostVersions) + " objects below " +
                      begin + ", which no case has: its legal hold was not " + doing);
        }
        versions.push_back(each);
      });
    }
    std::stable_partition(versions.begin(), versions.end(),
                          [](const ListedVersion& each) { return is_plain_key(each.key); });
    return versions;
  }
  static void require_plain(const ListedVersion& each, const std::string& doing) {
    if (is_plain_key(each.key)) return;
    throw Error("'" + printable(each.key) + "' in the store has a name that nothing of Kiroku gives: " +
                "its legal hold was not " + doing);
  }

  /// What the log says of a case's legal hold, on every version of its objects.
  void hold_of(const std::string& case_id, const std::vector<archive::Hold>& holds_of_case) {
    const bool standing = !holds_of_case.empty();
    const std::string doing = standing ? "set" : "lifted";
    for (const ListedVersion& each : versions_of(case_id, doing)) {
      if (ended()) return;
      require_plain(each, doing);
      require_hold(each.key, each.version, standing);
    }
    shipper.list_.set_hold(case_id, standing);
    if (standing) shipper.list_.set_hold_check(case_id, {entries_of(holds_of_case), shipper.time_.utc()});
    shipper.list_.keep();
  }

  /// Of every case that was ever held: of those that are, or of those that are no longer. What the store
  /// refuses keeps nothing from being shipped.
  void run_holds(bool standing) {
    if (holds == nullptr) return;
    for (const auto& [case_id, holds_of_case] : *holds) {
      if (standing == holds_of_case.empty() || shipper.list_.hold(case_id) == standing) continue;
      // By its copy of the log the store would hold less than it should.
      if (is_ended != nullptr && !ended() && (standing || log_went)) {
        guarded_of_case([&, &id = case_id, &of = holds_of_case] { hold_of(id, of); });
      }
      if (shipper.list_.hold(case_id) != standing) report.holds_waiting.push_back(case_id);
    }
  }

  /// What the store refuses of one case keeps no other from being looked at. Whether it was done.
  bool guarded_of_case(const std::function<void()>& work) {
    bool done = false;
    try {
      guarded([&] {
        work();
        done = true;
      });
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      report.problems.emplace_back(error.what());
    }
    return done;
  }

  /// Whether the store is to be asked again for what it confirmed of a case under legal hold.
  [[nodiscard]] bool is_to_be_looked_at(const std::string& case_id, const std::string& entries) {
    if (entries.empty() || shipper.list_.hold(case_id) != true) return false;
    const auto last = shipper.list_.hold_check(case_id);
    const UtcTime now = shipper.time_.utc();
    return !last || last->entries != entries || last->at > now || now - last->at >= kHoldsLookedAtAgain;
  }

  /// Whoever may set legal holds in the store may lift them, and nothing that was put tells of it.
  void look_at_holds_again() {
    if (holds == nullptr || is_ended == nullptr) return;
    std::uint64_t& most = left_to_look;
    std::optional<HoldLook>& look = shipper.look_;
    if (look) {
      const auto of_case = holds->find(look->case_id);
      if (of_case == holds->end() || entries_of(of_case->second) != look->entries) look.reset();
    }
    for (const auto& [case_id, holds_of_case] : *holds) {
      if (ended() || most == 0) return;
      const std::string entries = entries_of(holds_of_case);
      if (look ? look->case_id != case_id : !is_to_be_looked_at(case_id, entries)) continue;
      const bool done = guarded_of_case([&, &id = case_id] {
        if (!look) {
          look = HoldLook{id, entries, versions_of(id, kLookedAtAgain)};
          std::ranges::reverse(look->left);
        }
        look_on(*look, most);
        if (!look->left.empty()) return;
        shipper.list_.set_hold_check(id, {entries, shipper.time_.utc()});
        shipper.list_.keep();
        look.reset();
      });
      if (done) continue;
      // From now on its hold is set as of a case that was held just now, and told as waiting until it is.
      look.reset();
      shipper.list_.set_hold(case_id, false);
      report.holds_waiting.push_back(case_id);
    }
  }

  static constexpr const char* kLookedAtAgain = "looked at again";
  struct Lifted {
    std::uint64_t count = 0;
    std::string first;
    void add(const std::string& key) {
      if (count++ == 0) first = key;
    }
  };
  void look_on(HoldLook& look, std::uint64_t& most) {
    Lifted lifted, unlocked;
    const auto tell = [&](bool all_again) {
      tell_lifted(look.case_id, "legal hold", all_again, lifted);
      tell_lifted(look.case_id, "lock", all_again, unlocked);
    };
    try {
      while (!look.left.empty() && most > 0 && !ended()) {
        look_at(look.left.back(), lifted, unlocked);
        look.left.pop_back();
        --most;
      }
    } catch (...) {
      tell(false);
      throw;
    }
    tell(true);
  }
  void look_at(const ListedVersion& each, Lifted& lifted, Lifted& unlocked) {
    require_plain(each, kLookedAtAgain);
    ObjectStore& store = shipper.store_;
    const std::optional<StoredObject> there = store.look(each.key, each.version);
    if (!there) return;
    if (!there->legal_hold) {
      lifted.add(each.key);
      require_hold(each.key, each.version, true);
    }
    const std::optional<ShippedObject> known = shipper.list_.find(each.key);
    if (!known || known->version != each.version || known->lock_ends <= shipper.time_.utc() ||
        is_locked(*there, known->lock_ends))
      return;
    unlocked.add(each.key);
    store.set_retention(each.key, each.version, known->lock_ends);
    const std::optional<StoredObject> after = store.look(each.key, each.version);
    if (after && is_locked(*after, known->lock_ends)) return;
    throw Error("the store had locked " + each.key + " until " + format_utc(known->lock_ends) +
                ", and does not any more: its locks cannot be relied on ('kiroku ship --probe' tries them)");
  }
  /// In the report, and in the log: whoever lifted it has rights in the store, and may have none here.
  void tell_lifted(const std::string& case_id, const std::string& what, bool all_again,
                   const Lifted& lifted) {
    if (lifted.count == 0) return;
    const std::string found = "found the " + what + " of " + counted(lifted.count, "object", "objects") +
                              " of the case lifted in the store, " + lifted.first +
                              (lifted.count == 1 ? "" : " first") +
                              (all_again ? ", and set it again" : ", and could not set it again everywhere");
    shipper.lifted_.push_back("case " + case_id + " is under legal hold: 'kiroku ship' " + found +
                              ". Somebody who may do that in the store did it: ask its administrator who");
    if (shipper.terms_.state) guarded([&] { shipper.terms_.state(case_id, found); });
  }

  void recording(const std::string& name) {
    held = is_held(name);
    const fs::path place = archive / name;
    const FolderState state = state_of(place);
    if (shipper.list_.whole(name) == state.text) {
      log_went = log_went || name == kLogFolder;
      return;
    }
    const CaseFolder folder = CaseFolder::open(place);
    const auto tail = name == kLogFolder ? std::nullopt : archive::read_ledger_tail(place);
    const bool closed = tail && tail->closed;
    // What its lines name was there before them, and so is listed after it was opened.
    const archive::FileOpening ledger = folder.open_file(archive::kLedgerFile);
    std::vector<ListedFile> files = folder.list();
    std::ranges::stable_sort(files, {}, turn_of);
    std::uint64_t lines = closed ? tail->entries : shipper.list_.grown(name).lines;
    bool all_there = true, all_whole = true;
    for (const ListedFile& each : files) {
      if (ended()) return;
      if (each.kind == ListedFile::Kind::kFolder) continue;
      // A segment that is being written; one that stays incomplete keeps its name, and goes when the case is
      // closed.
      if (each.path.ends_with(archive::kPartSuffix) && !closed) continue;
      const Turn turn = turn_of(each);
      const std::string key = prefix() + name + "/" + each.path;
      const auto failed = [&](const Error& error) {
        report.problems.emplace_back(error.what());
        all_whole = false;
        // No ledger names a file that no store could have.
        if (is_plain_key(key)) all_there = false;
      };
      // A note may be of lines that came after the ledger was opened.
      if (turn != Turn::kNamedByLines && (!all_there || lines_of_note(each) > lines)) {
        all_whole = false;
        continue;
      }
      try {
        if (each.kind != ListedFile::Kind::kRegular)
          throw Error((place / each.path).string() + " is no regular file: it was not shipped");
        if (turn != Turn::kLedger || closed) {
          file(folder, each, key);
        } else if (ledger.file) {
          lines = growth(*ledger.file, name);
        }
      } catch (const StoreError& error) {
        if (!error.is_of_one_object()) throw;
        failed(error);
      } catch (const Error& error) {
        failed(error);
      }
    }
    if (name == kLogFolder) log_went = all_whole;
    if (is_ended != nullptr && !ended() && all_whole && state.newest + kSettled < shipper.time_.utc())
      shipper.list_.set_whole(name, state.text);
  }

  /// What goes wrong with one recording keeps no other from being shipped; what the store refuses does.
  void guarded(const std::function<void()>& work) {
    try {
      work();
    } catch (const StoreError&) {
      throw;
    } catch (const Error& error) {
      report.problems.emplace_back(error.what());
    }
  }

  void run() {
    guarded([&] { holds = &shipper.holds_in(archive / kLogFolder); });
    run_holds(true);
    ship_files();
    // Behind the log, so that whoever compares the two finds no case held there and not here.
    run_holds(false);
    if (!ended()) look_at_holds_again();
    lengthen_locks();
  }

  /// An object is locked for what was asked for when it was put. What the store refuses of that keeps nothing
  /// from being shipped.
  void lengthen_locks() {
    if (is_ended == nullptr) return;
    try {
      report.lengthened = shipper.lengthening_.go_on(left_to_look, *is_ended);
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      locks_problem = error.what();
    } catch (const Error& error) {
      locks_problem = error.what();
    }
  }
  /// Behind all else: what was shipped is whole all the same.
  void tell_of_locks() {
    report.locks_left = LockLengthening::left(shipper.list_, shipper.terms_.retention);
    if (locks_problem.empty() && report.locks_left) locks_problem = report.locks_left->problem;
    if (!locks_problem.empty())
      report.problems.push_back("not every lock in the store lasts as long as 'retain' in [store] asks: " +
                                locks_problem);
  }

  void ship_files() {
    std::vector<std::string> names = archive::real_reading().names_in(archive);
    // Cases in the order of their beginning; the log, which tells of them, behind.
    std::erase_if(names, [](const std::string& name) { return !archive::is_case_id(name); });
    if (archive::real_reading().is_folder(archive / kLogFolder)) names.emplace_back(kLogFolder);
    for (const std::string& name : names) {
      if (ended()) return;
      guarded([&] { recording(name); });
    }
    if (archive::real_reading().is_folder(archive / archive::kEvidenceFolder)) guarded([&] { evidence(); });
    if (!shipper.terms_.search.empty() && archive::real_reading().is_folder(shipper.terms_.search))
      guarded([&] { search_notes(); });
    if (!shipper.terms_.published.empty()) guarded([&] { published(); });
  }

  /// No ledger names them, and no legal hold is about them.
  void search_notes() {
    const fs::path& place = shipper.terms_.search;
    const std::string name(search::kStoreFolder);
    const FolderState state = state_of(place);
    if (shipper.list_.whole(name) == state.text) return;
    held = false;
    const CaseFolder folder = CaseFolder::open(place);
    for (const ListedFile& each : folder.list()) {
      if (ended()) return;
      if (each.kind != ListedFile::Kind::kRegular || search::case_of_note(each.path).empty()) continue;
      file(folder, each, prefix() + name + "/" + each.path);
    }
    if (is_ended != nullptr && state.newest + kSettled < shipper.time_.utc())
      shipper.list_.set_whole(name, state.text);
  }

  /// Hashes first, the checkpoint that is of them behind: whoever follows finds what it names. It is written
  /// last here, too, so that its own state is that of all.
  void published() {
    const fs::path& place = shipper.terms_.published;
    const auto state_now = [&]() -> std::optional<FolderState> {
      const auto checkpoint = archive::real_reading().status(place / kPublishedCheckpoint);
      if (!checkpoint) return {};
      return FolderState{std::to_string(checkpoint->last_change.time_since_epoch().count()) + " " +
                             std::to_string(checkpoint->bytes),
                         checkpoint->last_change};
    };
    const std::optional<FolderState> state = state_now();
    if (!state) return;
    const std::string name(kPublished);
    if (shipper.list_.whole(name) == state->text) return;
    held = false;
    const CaseFolder folder = CaseFolder::open(place);
    tiles(folder, std::string(kPublishedTiles), kMostTileLevels);
    if (ended()) return;
    // Another program may have published since: a newer one would go before hashes that it names. The next
    // look finds them.
    if (const auto now = state_now(); !now || now->text != state->text) return;
    published_file(folder, std::string(kPublishedCheckpoint));
    if (is_ended != nullptr && state->newest + kSettled < shipper.time_.utc())
      shipper.list_.set_whole(name, state->text);
  }
  void tiles(const CaseFolder& folder, const std::string& below, int levels) {
    const archive::FileReading& files = archive::real_reading();
    const fs::path place = folder.path() / below;
    if (!files.is_folder(place)) return;
    for (const std::string& each : files.names_in(place)) {
      if (ended()) return;
      const std::string path = below + "/" + each;
      if (!files.is_folder(folder.path() / path)) {
        published_file(folder, path);
      } else if (levels > 1) {
        tiles(folder, path, levels - 1);
      }
    }
  }
  void published_file(const CaseFolder& folder, const std::string& path) {
    const std::string key = prefix() + std::string(kPublished) + "/" + path;
    if (is_plain_key(key)) file(folder, {path}, key);
  }

  void evidence() {
    const std::string name(archive::kEvidenceFolder);
    const FolderState state = state_of(archive / name);
    if (shipper.list_.whole(name) == state.text) return;
    const CaseFolder folder = CaseFolder::open(archive / name);
    for (const ListedFile& each : folder.list()) {
      if (ended()) return;
      if (each.kind != ListedFile::Kind::kRegular || !each.path.ends_with(".ers")) continue;
      held = is_held(fs::path(each.path).stem().string());
      file(folder, each, prefix() + name + "/" + each.path);
    }
    if (is_ended != nullptr && state.newest + kSettled < shipper.time_.utc())
      shipper.list_.set_whole(name, state.text);
  }
};

Shipper::Shipper(ObjectStore& store, ShippingList& list, ShippingTerms terms, const Clock& time)
    : store_(store),
      list_(list),
      terms_(std::move(terms)),
      time_(time),
      lengthening_(store, list, terms_.appliance, terms_.retention, time) {}

/// A log of years is not read every five seconds.
const archive::Holds& Shipper::holds_in(const fs::path& log) {
  if (terms_.require_log) terms_.require_log();
  const std::string state = state_of(log).text;
  if (holds_read_of_ != state) {
    holds_ = archive::read_holds(log, terms_.device);
    holds_read_of_ = state;
  }
  return holds_;
}

ShippingReport Shipper::ship(const fs::path& archive, const std::function<bool()>& is_ended) {
  store_.require_lockable();
  Pass pass{*this, archive, &is_ended, {}};
  try {
    pass.run();
  } catch (...) {
    list_.keep();
    throw;
  }
  pass.report.lifted = std::exchange(lifted_, {});
  if (pass.ended() || !pass.report.problems.empty()) {
    list_.keep();
  } else {
    list_.finish();
  }
  pass.tell_of_locks();
  return pass.report;
}

ShippingReport Shipper::look(const fs::path& archive) {
  Pass pass{*this, archive, nullptr, {}};
  pass.run();
  pass.tell_of_locks();
  return pass.report;
}

LockProbe probe_lock(ObjectStore& store, const std::string& appliance, const Clock& time) {
  store.require_lockable();
  const UtcTime ends = time.utc() + std::chrono::minutes(1);
  const std::string text = "kiroku tries this store's locks\n";
  const std::string other = "kiroku tries to replace what is locked\n";
  const auto put = [&](const std::string& key, const std::string& what, const PutLock& lock) {
    return store.put(key, *crypto::memory_source(bytes_of(what)), crypto::sha256(bytes_of(what)), lock);
  };
  const auto removes = [&](const std::string& key, const std::string& version) {
    return store.remove(key, version) && !store.look(key, version);
  };
  LockProbe probe;
  probe.key = appliance + "/probe/" + format_utc_compact(time.utc());
  // A refusal says something of locks only where what is not locked can be removed.
  const std::string free = probe.key + ".free";
  probe.may_remove = removes(free, put(free, text, {}));
  const std::string held = probe.key + ".held";
  const std::string held_version = put(held, text, {.legal_hold = true});
  const auto told = store.look(held, held_version);
  probe.hold_removed = !told || !told->legal_hold || removes(held, held_version);
  if (store.look(held, held_version)) {
    store.set_legal_hold(held, held_version, false);
    store.remove(held, held_version);
  }
  probe.version = put(probe.key, text, {ends});
  const auto stored = store.look(probe.key, probe.version);
  probe.unlocked = !stored || !stored->compliance || !stored->lock_ends ||
                   *stored->lock_ends < std::chrono::floor<std::chrono::seconds>(ends);
  probe.removed = removes(probe.key, probe.version);
  if (probe.removed) return probe;
  put(probe.key, other, {ends});
  constexpr std::size_t kMost = 4096;
  probe.replaced = store.get(probe.key, probe.version, kMost) != to_bytes(text);
  return probe;
}

}  // namespace kiroku::fleet

#include "fleet/shipper.h"

#include <algorithm>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"
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
/// So many objects are entered into the list at once.
constexpr std::uint64_t kKeptTogether = 64;
constexpr std::string_view kLogFolder = "log";

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

bool is_ledger(const ListedFile& file) { return file.path == archive::kLedgerFile; }

}  // namespace

/// One look at the whole archive, with or without the store.
struct Shipper::Pass {
  Shipper& shipper;
  const fs::path& archive;
  const std::function<bool()>* is_ended = nullptr;  // null: nothing is sent
  ShippingReport report;

  [[nodiscard]] std::string prefix() const { return shipper.terms_.appliance + "/"; }
  [[nodiscard]] bool ended() const { return is_ended != nullptr && (*is_ended)(); }

  void wait(const FileState& file) {
    ++report.waiting;
    report.waiting_bytes += file.bytes;
    report.waiting_since = std::min(report.waiting_since.value_or(file.changed), file.changed);
  }

  /// Whether the store tells of the object as it must be.
  [[nodiscard]] static bool is_as_put(const StoredObject& stored, const ShippedObject& object) {
    return stored.bytes == object.file.bytes && stored.sha256 == object.sha256 && stored.compliance &&
           stored.lock_ends &&
           *stored.lock_ends >= std::chrono::floor<std::chrono::seconds>(object.lock_ends);
  }

  /// An earlier process put it, and could not enter it any more, or the list is another: nothing is put
  /// twice.
  bool take_up(const std::string& key, const StoredObject& there, ShippedObject object) {
    if (there.sha256 != object.sha256 || there.bytes != object.file.bytes || !there.compliance ||
        !there.lock_ends)
      return false;
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
    if (list.may_be_behind() && !list.find(key)) {
      const std::optional<StoredObject> there = shipper.store_.look(key);
      if (there && take_up(key, *there, object)) return;
    }
    list.before_putting();
    object.version = shipper.store_.put(key, source, hash, object.lock_ends);
    const std::optional<StoredObject> stored = shipper.store_.look(key, object.version);
    if (!stored || !is_as_put(*stored, object)) {
      throw Error("the store took " + key + ", and does not hold it as it was put, locked until " +
                  format_utc(object.lock_ends) +
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

  /// The lines of a ledger that were added since the last look.
  void growth(const CaseFolder& folder, const std::string& recording) {
    const archive::FileOpening opening = folder.open_file(archive::kLedgerFile);
    if (!opening.file) return;
    const auto status = archive::real_reading().status(folder.path() / archive::kLedgerFile);
    std::uint64_t begin = shipper.list_.grown(recording);
    if (is_ended != nullptr && shipper.list_.may_be_behind())
      begin = grown_in_store(*opening.file, recording, begin);
    while (!ended()) {
      const std::uint64_t end = std::min(opening.file->size(), begin + kLargestGrowth);
      const std::uint64_t bytes = begin < end ? whole_lines(*opening.file, begin, end) : 0;
      if (bytes == 0) return;
      const FileState state{bytes, status ? status->last_change : UtcTime{}};
      if (is_ended == nullptr) return wait(state);
      send(growth_key(prefix(), recording, begin), Stretch(*opening.file, begin, bytes), state);
      begin += bytes;
      shipper.list_.set_grown(recording, begin);
      // A part that is put again would have other lines by then.
      shipper.list_.keep();
    }
  }

  /// The parts that are in the store from byte `begin` on, which the list does not know: up to where they
  /// reach.
  std::uint64_t grown_in_store(const ReadableFile& ledger, const std::string& recording,
                               std::uint64_t begin) {
    for (;;) {
      const std::string key = growth_key(prefix(), recording, begin);
      const std::optional<StoredObject> there = shipper.store_.look(key);
      if (!there || there->bytes == 0 || there->bytes > ledger.size() - begin) return begin;
      const Stretch part(ledger, begin, there->bytes);
      if (!take_up(key, *there, {{there->bytes, {}}, crypto::to_hex(hash_of(part)), "", {}})) {
        throw Error(key + " in the store is no part of " + ledger.path().string() +
                    ": another appliance ships under the same name, or this one was restored from a copy");
      }
      begin += there->bytes;
      shipper.list_.set_grown(recording, begin);
    }
  }

  void recording(const std::string& name) {
    const CaseFolder folder = CaseFolder::open(archive / name);
    const bool is_log = name == kLogFolder;
    const auto tail = is_log ? std::nullopt : archive::read_ledger_tail(folder.path());
    const bool closed = tail && tail->closed;
    std::vector<ListedFile> files = folder.list();
    // What the ledger names stands in the store before the ledger does.
    std::ranges::stable_partition(files, [](const ListedFile& each) { return !is_ledger(each); });
    bool all_there = true;
    for (const ListedFile& each : files) {
      if (ended()) return;
      if (each.kind == ListedFile::Kind::kFolder) continue;
      // A segment that is being written; one that stays incomplete keeps its name, and goes when the case is
      // closed.
      if (each.path.ends_with(archive::kPartSuffix) && !closed) continue;
      const std::string key = prefix() + name + "/" + each.path;
      try {
        if (each.kind != ListedFile::Kind::kRegular)
          throw Error((folder.path() / each.path).string() + " is no regular file: it was not shipped");
        if (!is_ledger(each)) {
          file(folder, each, key);
        } else if (!closed) {
          growth(folder, name);
        } else if (all_there) {
          file(folder, each, key);
        }
      } catch (const StoreError&) {
        throw;
      } catch (const Error& error) {
        report.problems.emplace_back(error.what());
        // No ledger names a file that no store could have.
        if (is_plain_key(key)) all_there = false;
      }
    }
  }

  /// What goes wrong with one recording keeps no other from being shipped; what the store refuses does.
  void recording_of(const std::string& name) {
    try {
      recording(name);
    } catch (const StoreError&) {
      throw;
    } catch (const Error& error) {
      report.problems.emplace_back(error.what());
    }
  }

  void run() {
    std::vector<std::string> names = archive::real_reading().names_in(archive);
    // Cases in the order of their beginning; the log, which tells of them, behind.
    std::erase_if(names, [](const std::string& name) { return !archive::is_case_id(name); });
    if (archive::real_reading().is_folder(archive / kLogFolder)) names.emplace_back(kLogFolder);
    for (const std::string& name : names) {
      if (ended()) return;
      recording_of(name);
    }
    if (!archive::real_reading().is_folder(archive / archive::kEvidenceFolder)) return;
    const CaseFolder evidence = CaseFolder::open(archive / archive::kEvidenceFolder);
    for (const ListedFile& each : evidence.list()) {
      if (ended()) return;
      if (each.kind == ListedFile::Kind::kRegular && each.path.ends_with(".ers"))
        file(evidence, each, prefix() + std::string(archive::kEvidenceFolder) + "/" + each.path);
    }
  }
};

Shipper::Shipper(ObjectStore& store, ShippingList& list, ShippingTerms terms, const Clock& time)
    : store_(store), list_(list), terms_(std::move(terms)), time_(time) {}

ShippingReport Shipper::ship(const fs::path& archive, const std::function<bool()>& is_ended) {
  store_.require_lockable();
  Pass pass{*this, archive, &is_ended, {}};
  try {
    pass.run();
  } catch (...) {
    list_.keep();
    throw;
  }
  if (pass.ended() || !pass.report.problems.empty()) {
    list_.keep();
  } else {
    list_.finish();
  }
  return pass.report;
}

ShippingReport Shipper::look(const fs::path& archive) {
  Pass pass{*this, archive, nullptr, {}};
  pass.run();
  return pass.report;
}

LockProbe probe_lock(ObjectStore& store, const std::string& appliance, const Clock& time) {
  store.require_lockable();
  const UtcTime ends = time.utc() + std::chrono::minutes(1);
  const std::string text = "kiroku tries this store's locks\n";
  const std::string other = "kiroku tries to replace what is locked\n";
  const auto body = [](const std::string& of) { return crypto::memory_source(bytes_of(of)); };
  LockProbe probe;
  probe.key = appliance + "/probe/" + format_utc_compact(time.utc());
  probe.version = store.put(probe.key, *body(text), crypto::sha256(bytes_of(text)), ends);
  const auto stored = store.look(probe.key, probe.version);
  probe.unlocked = !stored || !stored->compliance || !stored->lock_ends ||
                   *stored->lock_ends < std::chrono::floor<std::chrono::seconds>(ends);
  probe.removed = store.remove(probe.key, probe.version) && !store.look(probe.key, probe.version);
  if (probe.removed) return probe;
  store.put(probe.key, *body(other), crypto::sha256(bytes_of(other)), ends);
  constexpr std::size_t kMost = 4096;
  probe.replaced = store.get(probe.key, probe.version, kMost) != to_bytes(text);
  return probe;
}

}  // namespace kiroku::fleet

#include "archive/writing/unsigned_lines.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fcntl.h>
#include <set>
#include <span>
#include <tuple>
#include <unistd.h>
#include <utility>
#include <vector>

#include "archive/format/boot_quote.h"
#include "archive/format/case_layout.h"
#include "archive/format/file_reading.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_aside.h"
#include "archive/storage/file_system.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/merkle_tree.h"
#include "crypto/secret.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;
using Kind = UnsignedLine::Kind;

constexpr std::size_t kChunk = 1U << 18U;
constexpr std::string_view kAsideSuffix = ".jsonl";

bool is_quote_of(const StatedQuote& stated, const std::string& attestation, const QuotePlace& place) {
  std::string problem;
  const auto area = crypto::from_base64(attestation, crypto::Base64Padding::kPadded);
  const auto key = area ? crypto::parse_attestation_key(*area, problem) : std::nullopt;
  const auto quote = from_stated(stated);
  const auto said = quote ? crypto::parse_tpm_quote(quote->attest, problem) : std::nullopt;
  if (!key || !said || said->qualified_signer != key->qualified_name ||
      !crypto::verify_ecdsa_p256(key->key, quote->attest, quote->signature)) {
    return false;
  }
  const crypto::Sha256Digest asked = qualifying_data(place);
  return std::ranges::equal(asked, said->qualifying_data) &&
         std::ranges::equal(said->pcrs, quote->pcrs, {}, {}, &crypto::PcrValue::index) &&
         said->pcr_digest == crypto::digest_of_pcrs(quote->pcrs);
}

bool is_same(const LogDamageEntry& one, const LogDamageEntry& other) {
  return one.size == other.size && one.stated_root == other.stated_root && one.root == other.root;
}

/// What the lines said so far, as far as it says what may follow.
class Judge {
 public:
  Judge(const LogKeys& own, const std::optional<LogDamageEntry>& damage) : own_(&own), damage_(&damage) {}

  /// Of one that is signed.
  void pass(std::string_view line) {
    constexpr std::string_view kType = R"("type":")";
    const std::size_t at = line.find(kType);
    const std::string_view type = at == std::string_view::npos ? "" : line.substr(at + kType.size());
    last_mono_ns_.reset();
    if (type.starts_with("boot\"") || type.starts_with("case-opened\"")) {
      if (const LogEntryParse parsed = parse_log_entry(line); parsed.entry) remember(*parsed.entry);
    }
    last_ = line;
  }

  struct Judgement {
    Kind kind = Kind::kForeign;
    std::optional<CaseOpenedEntry> opened;  // of a case that no line before it opens
  };
  Judgement judge(std::string_view line, bool too_long, const crypto::MerkleFrontier& before) {
    Judgement judged;
    const LogEntryParse parsed = too_long ? LogEntryParse{} : parse_log_entry(line);
    if (!parsed.entry) return judged;
    const LogEntry& entry = *parsed.entry;
    const bool boots = std::holds_alternative<BootEntry>(entry.body);
    if (entry.seq != before.size() || (!boots && entry.at.mono_ns < last_mono_ns())) return judged;
    judged.kind = kind_of(entry, before);
    if (const auto* opened = std::get_if<CaseOpenedEntry>(&entry.body);
        opened != nullptr && !opened_.contains(opened->case_id)) {
      judged.opened = *opened;
    }
    remember(entry);
    return judged;
  }

 private:
  void remember(const LogEntry& entry) {
    last_mono_ns_ = entry.at.mono_ns;
    if (const auto* boot = std::get_if<BootEntry>(&entry.body)) {
      boot_id_ = boot->boot_id;
    } else if (const auto* opened = std::get_if<CaseOpenedEntry>(&entry.body)) {
      opened_.insert(opened->case_id);
    }
  }

  /// Of the newest line that is an entry, or of those before it none.
  std::int64_t last_mono_ns() {
    if (!last_mono_ns_) {
      const LogEntryParse parsed = parse_log_entry(last_);
      last_mono_ns_ = parsed.entry ? parsed.entry->at.mono_ns : 0;
    }
    return *last_mono_ns_;
  }

  [[nodiscard]] Kind kind_of(const LogEntry& entry, const crypto::MerkleFrontier& before) const {
    const auto attends_if = [](bool it_does) { return it_does ? Kind::kAttends : Kind::kForeign; };
    const LogEntryBody& body = entry.body;
    if (const auto* boot = std::get_if<BootEntry>(&body)) {
      return attends_if(
          boot->device == own_->device &&
          (!boot->quote || is_quote_of(*boot->quote, own_->attestation,
                                       {own_->device, entry.seq, before.root(), boot->boot_id})));
    }
    if (const auto* added = std::get_if<DeviceMlDsaEntry>(&body)) {
      return attends_if(added->ml_dsa == own_->ml_dsa);
    }
    if (const auto* hardware = std::get_if<DeviceHardwareEntry>(&body)) {
      return attends_if(hardware->hardware == own_->hardware);
    }
    if (const auto* attests = std::get_if<DeviceAttestationEntry>(&body)) {
      return attends_if(
          attests->attestation == own_->attestation &&
          is_quote_of(attests->quote, own_->attestation, {own_->device, entry.seq, before.root(), boot_id_}));
    }
    if (std::holds_alternative<DeviceHardwareSilentEntry>(body)) return attends_if(!own_->hardware.empty());
    if (const auto* found = std::get_if<LogDamageEntry>(&body)) {
      return attends_if(damage_->has_value() && is_same(*found, **damage_));
    }
    if (std::holds_alternative<ConfigChangedEntry>(body) || std::holds_alternative<LogRecoveredEntry>(body)) {
      return Kind::kAttends;
    }
    if (const auto* changed = std::get_if<DeviceKeyChangedEntry>(&body)) {
      return changed->device == own_->device ? Kind::kKept : Kind::kForeign;
    }
    return std::holds_alternative<CaseOpenedEntry>(body) ? Kind::kKept : Kind::kStatement;
  }

  const LogKeys* own_;
  const std::optional<LogDamageEntry>* damage_;
  std::string boot_id_, last_;
  std::optional<std::int64_t> last_mono_ns_;
  std::set<std::string> opened_;
};

}  // namespace

UnsignedLines unsigned_lines(const FileReading& files, const fs::path& file, std::uint64_t from,
                             const LogKeys& own, const std::optional<LogDamageEntry>& damage,
                             const std::function<bool(const CaseOpenedEntry&)>& is_here) {
  const ReadableFile input = files.open_to_read(file);
  UnsignedLines lines;
  Judge judge(own, damage);
  crypto::MerkleFrontier tree;
  LineReader reader(input);
  if (from == 0) lines.root_before = tree.root();
  for (LedgerLine line; reader.next(line) && !line.torn;) {
    if (tree.size() < from) {
      judge.pass(line.text);
    } else {
      const Judge::Judgement judged = judge.judge(line.text, line.too_long, tree);
      const UnsignedLine here{judged.kind, tree.size(), line.offset};
      if (!lines.foreign && judged.kind == Kind::kForeign) lines.foreign = here;
      const bool demands = judged.kind != Kind::kAttends;
      if (lines.foreign) {
        lines.demanding_behind += demands ? 1 : 0;
        lines.opens_here = lines.opens_here || (judged.opened && is_here(*judged.opened));
      } else if (demands) {
        if (!lines.first) lines.first = here;
        ++lines.demanding;
      }
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    if (tree.size() == from) lines.root_before = tree.root();
  }
  lines.end = tree.size();
  lines.root = tree.root();
  return lines;
}

namespace {

/// So much of the lines that stay is written beside the log: more than any recorder enters in its life.
constexpr std::uint64_t kMostBytesMarked = std::uint64_t{8} << 30U;

fs::path with_suffix(fs::path file, std::string_view suffix) {
  file += suffix;
  return file;
}

std::string random_name() {
  std::array<std::byte, 8> random{};
  crypto::fill_random(random);
  return crypto::to_hex(random);
}

/// The next bytes from `at` on that take room on the disk, before `end`: where they begin and end; nothing
/// where none do. Where the file system tells of no holes, all are.
std::optional<std::pair<std::uint64_t, std::uint64_t>> next_stretch(const Descriptor& file, std::uint64_t at,
                                                                    std::uint64_t end) {
  if (at >= end) return std::nullopt;
  const off_t begins = ::lseek(file.number(), static_cast<off_t>(at), SEEK_DATA);
  if (begins < 0) return errno == ENXIO ? std::nullopt : std::optional(std::pair(at, end));
  const std::uint64_t begin = std::max(at, static_cast<std::uint64_t>(begins));
  if (begin >= end) return std::nullopt;
  const off_t hole = ::lseek(file.number(), begins, SEEK_HOLE);
  const bool is_told = hole > static_cast<off_t>(begin);
  return std::pair(begin, is_told ? std::min(end, static_cast<std::uint64_t>(hole)) : end);
}

/// Whether all of it is copied: a file system may tell of holes where there are none.
bool is_little(const ReadableFile& input, std::uint64_t offset) {
  return input.size() - std::min(offset, input.size()) <= kMostBytesAside;
}

/// Hands `write` the first kMostBytesAside that take room on the disk, from byte `offset` on.
void copy_bounded(const FileReading& files, const ReadableFile& input, std::uint64_t offset,
                  const std::function<void(ByteView)>& write) {
  const Descriptor holes(
      files.open_at(AT_FDCWD, input.path().native(), O_NOFOLLOW | O_NONBLOCK, input.path()));
  if (!holes) throw IoError("read", input.path(), errno);
  std::vector<std::byte> chunk(kChunk);
  std::uint64_t left = kMostBytesAside;
  const bool is_all_copied = is_little(input, offset);
  const auto next = [&] {
    const bool is_whole = is_all_copied && offset < input.size();
    return is_whole ? std::optional(std::pair(offset, input.size()))
                    : next_stretch(holes, offset, input.size());
  };
  while (const auto stretch = next()) {
    for (offset = stretch->first; offset < stretch->second;) {
      const std::uint64_t most = std::min({left, stretch->second - offset, std::uint64_t{kChunk}});
      const std::size_t count = input.read_at(offset, std::span(chunk).first(static_cast<std::size_t>(most)));
      if (count == 0) return;
      write(std::span(chunk).first(count));
      offset += count;
      left -= count;
    }
  }
}

void make_folder_beside(FileSystem& files, const fs::path& folder) {
  if (!files.exists(folder)) {
    files.make_folder(folder);
    files.sync_folder(folder.parent_path());
  }
  // Whoever can write there may have made a link to another place.
  if (!files.is_folder(folder)) throw IoError("write into the folder", folder, ENOTDIR);
}

void remove_if_there(FileSystem& files, const fs::path& file) {
  if (files.exists(file)) files.remove(file);
}

/// A file beside the log that has no name of its own yet. Without finish() nothing is left of it.
class AsidePart {
 public:
  AsidePart(FileSystem& files, const fs::path& folder, std::uint64_t line, std::string_view suffix)
      : files_(files), folder_(folder), line_(line), part_(with_suffix(folder / format_index(line), suffix)) {
    remove_if_there(files_, part_);
    written_ = files_.create(part_);
  }
  AsidePart(const AsidePart&) = delete;
  AsidePart& operator=(const AsidePart&) = delete;
  ~AsidePart() {
    if (!written_) return;
    written_.reset();
    try {
      remove_if_there(files_, part_);
    } catch (...) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
    }
  }
  void write(ByteView bytes) {
    hash_.update(bytes);
    written_->write(bytes);
    bytes_ += bytes.size();
  }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Its durable name, for which the folder is to be flushed, and its hash.
  SetAside finish(Telling telling) {
    written_->sync_all();
    SetAside kept;
    kept.kept = kept.stood = bytes_;
    kept.sha256 = crypto::to_hex(hash_.finish());
    kept.file = folder_ / (format_index(line_) + "-" + kept.sha256 + std::string(kAsideSuffix));
    files_.rename(part_, telling == Telling::kFollows ? with_suffix(kept.file, kUntoldSuffix) : kept.file);
    written_.reset();
    return kept;
  }

 private:
  FileSystem& files_;
  const fs::path folder_;
  const std::uint64_t line_;
  const fs::path part_;
  std::unique_ptr<WritableFile> written_;  // null once it has its name
  crypto::Sha256 hash_;
  std::uint64_t bytes_ = 0;
};

SetAside set_aside_in(FileSystem& files, const fs::path& file, std::uint64_t line, std::uint64_t offset,
                      const fs::path& folder, Telling telling) {
  make_folder_beside(files, folder);
  AsidePart part(files, folder, line, kPartSuffix);
  const ReadableFile input = files.open_to_read(file);
  copy_bounded(files, input, offset, [&](ByteView bytes) { part.write(bytes); });
  SetAside kept = part.finish(telling);
  kept.stood = input.size() - std::min(offset, input.size());
  files.sync_folder(folder);
  return kept;
}

/// In log-aside/ of `archive`, or where that cannot be done, in another folder beside it.
template <typename Write>  // Result(const fs::path& folder)
auto in_a_folder_beside(const fs::path& archive, const Write& write) {
  constexpr int kNumbered = 4;
  const std::string name(kLogAsideFolder);
  for (int number = 1; number <= kNumbered; ++number) {
    try {
      return write(archive / (number == 1 ? name : name + "-" + std::to_string(number)));
    } catch (const IoError& error) {
      if (error.disk_full()) throw;  // no other folder has more room
    }
  }
  // Whoever can write to the archive may have put something into the way of each.
  return write(archive / (name + "-" + random_name()));
}

/// Lines as they stand, but for those that are none of the format.
class MarkedLines {
 public:
  MarkedLines(AsidePart& lines, AsidePart& changed, std::uint64_t line, std::uint64_t offset,
              std::uint64_t covered)
      : lines_(lines), changed_(changed), number_(line), begin_(offset), at_(offset), covered_(covered) {}

  /// These that read as zeros and take no room. False where the next line is not to stay.
  bool take_hole(std::uint64_t bytes) { return add({}, bytes, true); }
  bool take(std::string_view text) {
    while (!text.empty()) {
      const std::size_t end = text.find('\n');
      const std::string_view piece = text.substr(0, end);
      if (!add(piece, piece.size(), piece.find('\0') != std::string_view::npos)) return false;
      if (end == std::string_view::npos) return true;
      ++at_;
      if (!end_line()) return false;
      text.remove_prefix(end + 1);
    }
    return true;
  }
  /// At the end of the file, what stands behind the last LF is a line, too, if a checkpoint covers it.
  void finish(bool is_end) {
    if (is_end && bytes_ > 0 && number_ < covered_) end_line();
    flush();
  }
  [[nodiscard]] std::uint64_t changed_lines() const { return changed_lines_; }
  [[nodiscard]] std::uint64_t changed_bytes() const { return changed_bytes_; }
  /// The line that is not to stay, where there is one.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  [[nodiscard]] std::uint64_t begin() const { return begin_; }

 private:
  bool add(std::string_view piece, std::uint64_t bytes, bool has_zero) {
    bytes_ += bytes;
    at_ += bytes;
    if (!is_changed_) {
      text_ += piece;
      if (!has_zero && bytes_ <= kMaximumLineBytes) return true;
      if (number_ >= covered_) return false;
      is_changed_ = true;
      keep(text_);
      text_.clear();
    } else {
      keep(piece);
    }
    return true;
  }
  bool end_line() {
    if (number_ >= covered_) {
      uncovered_ += text_.size() + 1;
      if (uncovered_ > kMostBytesAside) return false;
    }
    if (lines_.bytes() + ready_.size() > kMostBytesMarked) return false;
    if (is_changed_) {
      ++changed_lines_;
      changed_bytes_ += bytes_;
      text_ = "set aside: a line of " + std::to_string(bytes_) + " bytes, which no entry has";
    }
    ready_ += text_;
    ready_ += '\n';
    if (ready_.size() >= kChunk) flush();
    text_.clear();
    bytes_ = 0;
    is_changed_ = false;
    ++number_;
    begin_ = at_;
    return true;
  }
  void flush() {
    if (!ready_.empty()) lines_.write(bytes_of(ready_));
    ready_.clear();
  }
  void keep(std::string_view piece) {
    const std::uint64_t left = kMostBytesAside - std::min(kMostBytesAside, changed_.bytes());
    changed_.write(
        bytes_of(piece.substr(0, static_cast<std::size_t>(std::min<std::uint64_t>(left, piece.size())))));
  }

  AsidePart &lines_, &changed_;
  std::uint64_t number_;
  std::uint64_t begin_, at_;  // of the line, and of what comes next
  const std::uint64_t covered_;
  std::string text_, ready_;
  std::uint64_t bytes_ = 0;  // of the line so far
  bool is_changed_ = false;
  std::uint64_t uncovered_ = 0, changed_lines_ = 0, changed_bytes_ = 0;
};

/// Whether a file that is told to have a hole there has one, and a long one: what is short is read.
bool is_hole(const ReadableFile& input, std::uint64_t begin, std::uint64_t end) {
  constexpr std::uint64_t kShort = 1U << 16U;
  if (end - begin <= kShort) return false;
  std::array<std::byte, 4096> there{};
  for (const std::uint64_t at : {begin, end - there.size()}) {
    const std::size_t count = input.read_at(at, there);
    if (std::ranges::any_of(std::span(there).first(count),
                            [](std::byte each) { return each != std::byte{}; }))
      return false;
  }
  return true;
}

ChangedAside set_changed_aside_in(FileSystem& files, const fs::path& file, std::uint64_t line,
                                  std::uint64_t offset, std::uint64_t covered, const fs::path& folder) {
  make_folder_beside(files, folder);
  AsidePart lines(files, folder, line, std::string(".lines") + std::string(kPartSuffix));
  AsidePart changed(files, folder, line, kPartSuffix);
  const ReadableFile input = files.open_to_read(file);
  const Descriptor holes(
      files.open_at(AT_FDCWD, input.path().native(), O_NOFOLLOW | O_NONBLOCK, input.path()));
  if (!holes) throw IoError("read", input.path(), errno);
  MarkedLines marked(lines, changed, line, offset, covered);
  std::string chunk(kChunk, '\0');
  bool all_stay = true;
  while (all_stay) {
    const auto stretch = next_stretch(holes, offset, input.size());
    std::uint64_t begin = stretch ? stretch->first : input.size();
    if (!is_hole(input, offset, begin)) begin = offset;
    if (begin > offset) all_stay = marked.take_hole(begin - offset);
    offset = begin;
    const std::uint64_t end = stretch ? stretch->second : input.size();
    if (offset == end) break;
    while (all_stay && offset < end) {
      const std::uint64_t most = std::min(end - offset, std::uint64_t{kChunk});
      const std::size_t count = input.read_at(
          offset, std::as_writable_bytes(std::span(chunk).first(static_cast<std::size_t>(most))));
      if (count == 0) throw Error(file.string() + " became shorter while it was read");
      all_stay = marked.take(std::string_view(chunk).substr(0, count));
      offset += count;
    }
  }
  marked.finish(all_stay);
  ChangedAside aside;
  aside.lines = marked.changed_lines();
  if (!all_stay) aside.rest = ChangedAside::Rest{marked.number(), marked.begin()};
  if (aside.lines > 0) {
    aside.kept = changed.finish(Telling::kFollows);
    aside.kept.stood = marked.changed_bytes();
  }
  aside.instead = with_suffix(lines.finish(Telling::kFollows).file, kUntoldSuffix);
  files.sync_folder(folder);
  return aside;
}

/// What a name says, if it is one that is not told yet.
std::optional<UntoldAside> untold_of_name(const fs::path& folder, std::string_view name) {
  const std::string end = std::string(kAsideSuffix) + std::string(kUntoldSuffix);
  const std::size_t dash = name.find('-');
  if (dash == std::string_view::npos || !name.ends_with(end)) return std::nullopt;
  const std::optional<std::uint64_t> line = parse_index(name.substr(0, dash));
  const std::string_view hash = name.substr(0, name.size() - end.size()).substr(dash + 1);
  constexpr std::size_t kDigits = 2 * std::tuple_size_v<crypto::Sha256Digest>;
  if (!line || hash.size() != kDigits || hash.find_first_not_of("0123456789abcdef") != std::string_view::npos)
    return std::nullopt;
  return UntoldAside{*line, {folder / name.substr(0, name.size() - kUntoldSuffix.size()), std::string(hash)}};
}

}  // namespace

SetAside set_aside(FileSystem& files, const fs::path& file, std::uint64_t line, std::uint64_t offset,
                   const fs::path& archive, Telling telling) {
  return in_a_folder_beside(archive, [&](const fs::path& folder) {
    return set_aside_in(files, file, line, offset, folder, telling);
  });
}

ChangedAside set_changed_aside(FileSystem& files, const fs::path& file, std::uint64_t line,
                               std::uint64_t offset, std::uint64_t covered, const fs::path& archive) {
  return in_a_folder_beside(archive, [&](const fs::path& folder) {
    return set_changed_aside_in(files, file, line, offset, covered, folder);
  });
}

std::uint64_t bytes_to_keep(const FileReading& files, const fs::path& file, std::uint64_t offset) {
  const ReadableFile input = files.open_to_read(file);
  if (is_little(input, offset)) return input.size() - std::min(offset, input.size());
  const Descriptor holes(files.open_at(AT_FDCWD, file.native(), O_NOFOLLOW | O_NONBLOCK, file));
  if (!holes) throw IoError("read", file, errno);
  std::uint64_t bytes = 0;
  while (bytes < kMostBytesAside) {
    const auto stretch = next_stretch(holes, offset, input.size());
    if (!stretch) break;
    bytes += stretch->second - stretch->first;
    offset = stretch->second;
  }
  return std::min(bytes, kMostBytesAside);
}

std::vector<UntoldAside> untold_asides(const FileReading& files, const fs::path& archive, std::size_t most) {
  std::vector<UntoldAside> untold;
  for (const std::string& folder_name : files.names_in(archive)) {
    const fs::path folder = archive / folder_name;
    if (!is_log_aside_name(folder_name) || !files.is_folder(folder)) continue;
    for (const std::string& name : files.names_in(folder)) {
      if (untold.size() == most) return untold;
      std::optional<UntoldAside> each = untold_of_name(folder, name);
      if (!each) continue;
      const std::optional<FileStatus> there = files.status(folder / name);
      if (there && there->kind == FileStatus::Kind::kRegular) untold.push_back(std::move(*each));
    }
  }
  return untold;
}

void name_as_told(FileSystem& files, const SetAside& kept) {
  const fs::path untold = with_suffix(kept.file, kUntoldSuffix);
  try {
    files.rename(untold, kept.file);
  } catch (const IoError&) {
    // A folder has the name. Else each start would find the file again.
    const std::string name = kept.file.filename().string();
    const std::size_t dash = name.find('-');
    files.rename(untold, kept.file.parent_path() / (name.substr(0, dash) + "-" + random_name() +
                                                    name.substr(std::min(dash, name.size()))));
  }
  files.sync_folder(kept.file.parent_path());
}

}  // namespace kiroku::archive

#include "archive/case_writer.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include "archive/appliance_log.h"
#include "archive/case_folder.h"
#include "archive/case_layout.h"
#include "archive/checkpoint_rules.h"
#include "archive/file_system.h"
#include "archive/ledger.h"
#include "archive/space_reserve.h"
#include "archive/token_rules.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kLogIntervalNs = 60'000'000'000;
constexpr std::size_t kPemColumns = 64;  // RFC 7468 section 2

/// A case folder under its hidden name. Removed with all its contents unless it gets its own name and is
/// kept.
class NewFolder {
 public:
  NewFolder(FileSystem& files, fs::path final_path)
      : files_(files),
        path_(final_path.parent_path() / (".new-" + final_path.filename().string())),
        final_path_(std::move(final_path)) {
    files_.make_folder(path_);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    if (!kept_) {
      try {
        remove_tree(files_, path_);
      } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the error that led here is the one
                                         // to tell
      }
    }
  }
  [[nodiscard]] const fs::path& path() const { return path_; }
  void give_final_name() {
    if (fs::exists(fs::symlink_status(final_path_))) {
      throw Error("there is a case " + final_path_.string() + " already: try again");
    }
    files_.rename(path_, final_path_);
    path_ = final_path_;
    files_.sync_folder(path_.parent_path());
  }
  void keep() { kept_ = true; }

 private:
  FileSystem& files_;
  fs::path path_;
  fs::path final_path_;
  bool kept_ = false;
};

std::string new_case_id(UtcTime now) {
  std::array<std::byte, 4> random{};
  crypto::fill_random(random);
  return format_utc_compact(now) + "-" + crypto::to_hex(random);
}

void check(const CaseWriter::Options& options) {
  if (options.key == nullptr) {
    throw UsageError("a case cannot be made without a device key");
  }
  if (!fs::is_directory(options.archive)) {
    throw UsageError("there is no archive folder " + options.archive.string() +
                     ": make it, or make a home with `kiroku init`");
  }
  if (options.streams.empty() || options.streams.size() != options.stream_recipients.size()) {
    throw UsageError("a case needs at least one stream, and recipients for each");
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < options.streams.size(); ++i) {
    const StreamInfo& stream = options.streams[i];
    if (!is_short_name(stream.name)) {
      throw UsageError("a stream cannot be called \"" + stream.name +
                       "\": use up to 32 of a-z, 0-9 and '-', not '-' first");
    }
    if (!names.insert(stream.name).second) {
      throw UsageError("two streams are called \"" + stream.name + "\": give each its own name");
    }
    if (!extension_of_media(stream.media)) {
      throw UsageError("stream " + stream.name + " is of media type \"" + stream.media +
                       "\", which the case format does not have");
    }
    if (options.stream_recipients[i].empty()) {
      throw UsageError("stream " + stream.name + " has no recipient: nobody could ever see it");
    }
  }
  if (options.subject && options.subject_recipients.empty()) {
    throw UsageError("the subject has no recipient: nobody could ever read it");
  }
}

/// Streams as `open` states them: recipients are those the segments will really be sealed to.
std::vector<StreamInfo> declared_streams(const CaseWriter::Options& options) {
  std::vector<StreamInfo> streams = options.streams;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    streams[i].extension = *extension_of_media(streams[i].media);
    streams[i].recipients.clear();
    for (const auto& recipient : options.stream_recipients[i]) {
      streams[i].recipients.push_back(recipient->to_string());
    }
  }
  return streams;
}

void make_folders(FileSystem& files, const fs::path& folder, const std::vector<StreamInfo>& streams) {
  for (const std::string_view name :
       {kCheckpointsFolder, kTokensFolder, kSegmentsFolder, kAuthoritiesFolder}) {
    files.make_folder(folder / name);
  }
  for (const StreamInfo& stream : streams) {
    files.make_folder(folder / kSegmentsFolder / stream.name);
  }
  files.sync_folder(folder / kSegmentsFolder);
}

FileReference store_subject(FileSystem& files, const fs::path& folder, ByteView subject,
                            const crypto::AgeRecipients& recipients) {
  const Bytes sealed = crypto::seal_bytes(subject, recipients);
  files.write_durably(folder / kSubjectFile, sealed);
  return {std::string(kSubjectFile), sealed.size(), crypto::sha256(sealed)};
}

std::string pem_of(ByteView der) {
  const std::string base64 = crypto::to_base64(der, crypto::Base64Padding::kPadded);
  std::string pem = "-----BEGIN CERTIFICATE-----\n";
  for (std::size_t at = 0; at < base64.size(); at += kPemColumns) {
    pem += base64.substr(at, kPemColumns) + "\n";
  }
  return pem + "-----END CERTIFICATE-----\n";
}

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

}  // namespace

struct CaseWriter::State {
  enum class Stage { kRecording, kClosed, kFinished };
  struct Stream {
    StreamInfo info;
    crypto::AgeRecipients recipients;
    std::optional<std::uint64_t> last_index;
    StreamTotal total;
  };

  State(FileSystem& the_files, const crypto::SigningKey* the_key, std::string device, ApplianceLog* the_log,
        const fs::path& archive)
      : files(the_files),
        key(the_key),
        device_name(std::move(device)),
        log(the_log),
        reserve(the_files, reserve_file(archive)) {}

  void refuse_unless_writable() const {
    if (!failure.empty()) {
      throw Error(failure);
    }
    if (stage == Stage::kFinished) {
      throw UsageError("case " + case_id + " is finished: nothing can be added to it");
    }
  }

  /// Runs a step that makes something durable; a failed flush is final for the whole case.
  template <typename Step>
  void durably(Step step) {
    try {
      step();
    } catch (const SyncError& error) {
      failure =
          "case " + case_id + " can no longer be written, since a flush to the disk failed: " + error.what();
      throw;
    }
  }

  Stream& stream(const std::string& name) {
    const auto found = std::find_if(streams.begin(), streams.end(),
                                    [&](const Stream& each) { return each.info.name == name; });
    if (found == streams.end()) {
      throw UsageError("case " + case_id + " has no stream \"" + name + "\"");
    }
    return *found;
  }

  /// What an entry says must be so before it is written.
  void check_segment(const SegmentEntry& segment, std::map<std::string, std::uint64_t>& last_in_batch);
  void check_authority(const std::string& authority) const;
  void check_all(const std::vector<CaseEntryBody>& bodies);
  void write_entries(const std::vector<CaseEntryBody>& bodies, Moment now);
  void enter_token(std::uint64_t checkpoint, const std::string& authority, const crypto::Sha256Digest& sha256,
                   const TokenEntry& facts, Moment now);
  /// Keeps count of what is in the ledger, written just now or found there.
  void account_for(const CaseEntryBody& body);
  void take_opening(const CaseEntry& entry, const std::string& device);
  void take_newest_note(std::uint64_t size, const crypto::Sha256Digest& root);

  FileSystem& files;
  const crypto::SigningKey* key;
  std::string device_name;
  ApplianceLog* log;
  SpaceReserve reserve;
  std::string case_id;
  fs::path folder;
  std::vector<Stream> streams;
  std::unique_ptr<Ledger> ledger;
  std::uint64_t torn_bytes = 0;
  std::int64_t last_mono_ns = 0;
  std::optional<StoredCheckpoint> last_checkpoint;
  std::optional<std::int64_t> last_logged_ns;
  std::optional<crypto::Sha256Digest> final_token;
  Stage stage = Stage::kRecording;
  std::string failure;  // once set, everything is refused with it
};

CaseWriter::CaseWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
CaseWriter::~CaseWriter() = default;

// Under the hidden name: folders, subject, device key, ledger with `open`, each durable; then
//
//   rename(.new-ID, ID)   fsync(archive)   → the case exists   → case-opened in the appliance log
//
std::unique_ptr<CaseWriter> CaseWriter::create(FileSystem& files, const Options& options, Moment now) {
  check(options);
  auto state = std::make_unique<State>(files, options.key, options.device_name, options.log, options.archive);
  state->reserve.fill();
  state->case_id = new_case_id(now.utc);
  state->folder = options.archive / state->case_id;

  OpenEntry open;
  open.case_id = state->case_id;
  open.device = crypto::VerifierKey(options.device_name, options.key->public_key()).to_string();
  open.boot_id = options.boot_id;
  open.streams = declared_streams(options);
  open.plan = options.plan;
  open.begins_ns = options.begins_ns;
  open.appliance_log_root = crypto::MerkleFrontier().root();
  if (options.log != nullptr) {
    const ApplianceLog::Head head = options.log->head();
    open.appliance_log_size = head.size;
    open.appliance_log_root = head.root;
  }
  for (std::size_t i = 0; i < open.streams.size(); ++i) {
    state->streams.push_back({open.streams[i], options.stream_recipients[i], {}, {}});
  }

  NewFolder folder(files, state->folder);
  make_folders(files, folder.path(), open.streams);
  if (options.subject) {
    open.subject = store_subject(files, folder.path(), *options.subject, options.subject_recipients);
  }
  files.write_durably(folder.path() / kDeviceFile, bytes_of(open.device + "\n"));
  const std::string line = to_line({0, now, open});
  files.write_durably(folder.path() / kLedgerFile, bytes_of(line + "\n"));
  folder.give_final_name();
  state->ledger =
      Ledger::open(files, state->folder / kLedgerFile, Ledger::Sharing::kExclusive, &state->reserve);
  state->last_mono_ns = now.mono_ns;
  // From here on the log may know the case, even if its own flush fails: it must not vanish.
  folder.keep();
  if (options.log != nullptr) {
    options.log->case_opened(state->case_id, crypto::sha256(bytes_of(line)));
  }
  return std::unique_ptr<CaseWriter>(new CaseWriter(std::move(state)));
}

namespace {

/// Size of the newest note in the folder; 0 if there is none.
std::uint64_t newest_note(const fs::path& folder) {
  std::uint64_t newest = 0;
  for (const fs::directory_entry& file : fs::directory_iterator(folder / kCheckpointsFolder)) {
    newest = std::max(newest, size_of_note_name(file.path().filename().string()).value_or(0));
  }
  return newest;
}

[[noreturn]] void refuse_damaged(const fs::path& folder, const std::string& what) {
  throw Error("case " + folder.filename().string() + " is not taken up again, since " + what +
              ": `kiroku verify " + folder.string() + "` says more");
}

}  // namespace

void CaseWriter::State::take_opening(const CaseEntry& entry, const std::string& device) {
  const auto* open = std::get_if<OpenEntry>(&entry.body);
  if (open == nullptr) {
    refuse_damaged(folder, "its ledger does not begin with open");
  }
  if (open->device != device) {
    throw UsageError("case " + folder.filename().string() + " was recorded by another device, " +
                     open->device + ": only that one can bring it to an end");
  }
  if (open->case_id != folder.filename().string()) {
    refuse_damaged(folder, "its ledger is that of case " + open->case_id);
  }
  case_id = open->case_id;
  for (const StreamInfo& info : open->streams) {
    streams.push_back({info, {}, {}, {}});
  }
}

void CaseWriter::State::take_newest_note(std::uint64_t size, const crypto::Sha256Digest& root) {
  const fs::path file = folder / note_path(size);
  const FileOpening opening = CaseFolder::open(folder).open_file(note_path(size));
  const std::optional<std::string> note =
      opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  if (!note) {
    refuse_damaged(folder, file.string() + " cannot be read");
  }
  const crypto::OpenedNote opened =
      crypto::open_note(*note, {crypto::VerifierKey(device_name, key->public_key())});
  const std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (opened.failure || !checkpoint || checkpoint->origin != case_origin(device_name, case_id) ||
      checkpoint->size != size || checkpoint->root != root) {
    refuse_damaged(folder,
                   "its newest checkpoint, " + file.filename().string() + ", does not fit its ledger");
  }
  last_checkpoint = StoredCheckpoint{size, root, *note, file};
}

std::unique_ptr<CaseWriter> CaseWriter::resume(FileSystem& files, const fs::path& folder,
                                               const crypto::SigningKey& key, const std::string& device_name,
                                               ApplianceLog* log,
                                               const std::function<void(const CaseEntry&)>& visit) {
  auto state = std::make_unique<State>(files, &key, device_name, log, folder.parent_path());
  state->folder = folder;
  const std::uint64_t newest = newest_note(folder);
  const std::string device = crypto::VerifierKey(device_name, key.public_key()).to_string();
  crypto::MerkleFrontier tree;
  std::optional<crypto::Sha256Digest> root;  // that the newest note must state
  const auto take = [&](std::uint64_t seq, std::string_view line) {
    const EntryParse parse = parse_case_entry(line);
    if (!parse.entry || parse.entry->seq != seq) {
      refuse_damaged(folder, "line " + std::to_string(seq + 1) + " of its ledger is no entry" +
                                 (parse.problem.empty() ? "" : " (" + parse.problem + ")"));
    }
    if (seq == 0) {
      state->take_opening(*parse.entry, device);
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (tree.size() == newest) {
      root = tree.root();
    }
    state->last_mono_ns = std::max(state->last_mono_ns, parse.entry->at.mono_ns);
    state->account_for(parse.entry->body);
    visit(*parse.entry);
  };
  // Only what stands there already is of interest, not what is appended later.
  const auto reading = std::make_shared<Ledger::Visitor>(take);
  state->ledger = Ledger::open(files, folder / kLedgerFile, Ledger::Sharing::kExclusive, &state->reserve,
                               [reading](std::uint64_t seq, std::string_view line) {
                                 if (*reading) {
                                   (*reading)(seq, line);
                                 }
                               });
  *reading = nullptr;
  state->torn_bytes = state->ledger->torn_bytes();
  if (state->ledger->size() == 0) {
    refuse_damaged(folder, "its ledger holds no whole entry");
  }
  if (newest > state->ledger->size()) {
    refuse_damaged(folder, "a checkpoint covers " + std::to_string(newest) + " entries and there are " +
                               std::to_string(state->ledger->size()));
  }
  if (newest > 0) {
    state->take_newest_note(newest, *root);
  }
  return std::unique_ptr<CaseWriter>(new CaseWriter(std::move(state)));
}

const std::string& CaseWriter::case_id() const { return state_->case_id; }
const fs::path& CaseWriter::folder() const { return state_->folder; }
std::uint64_t CaseWriter::size() const { return state_->ledger->size(); }
std::uint64_t CaseWriter::covered() const {
  return state_->last_checkpoint ? state_->last_checkpoint->size : 0;
}
std::uint64_t CaseWriter::torn_bytes() const { return state_->torn_bytes; }

std::unique_ptr<SegmentWriter> CaseWriter::begin_segment(std::size_t stream_index,
                                                         std::uint64_t segment_index) {
  const State::Stream& stream = state_->streams.at(stream_index);
  if (stream.recipients.empty()) {
    throw UsageError("case " + state_->case_id +
                     " was taken up again to be brought to its end: nothing more is recorded in it");
  }
  const std::string relative = segment_path(stream.info.name, segment_index, stream.info.extension);
  const fs::path path = state_->folder / relative;
  if (fs::exists(fs::symlink_status(path))) {
    throw UsageError("there is a segment " + path.string() + " already: segments are written once");
  }
  return std::make_unique<SegmentWriter>(state_->files, path, relative, stream.recipients);
}

void CaseWriter::take_in(SegmentEntry& segment, const fs::path& from) {
  State& state = *state_;
  state.refuse_unless_writable();
  std::string relative =
      segment_path(segment.stream, segment.index, state.stream(segment.stream).info.extension);
  if (!segment.complete) {
    relative += kPartSuffix;
  }
  const fs::path target = state.folder / relative;
  if (fs::exists(fs::symlink_status(target))) {
    throw UsageError("there is a segment " + target.string() + " already: segments are written once");
  }
  state.durably([&] {
    state.files.rename(from, target);
    state.files.sync_folder(target.parent_path());
  });
  segment.file.file = relative;
}

void CaseWriter::State::check_segment(const SegmentEntry& segment,
                                      std::map<std::string, std::uint64_t>& last_in_batch) {
  const Stream& its_stream = stream(segment.stream);
  std::string expected = segment_path(segment.stream, segment.index, its_stream.info.extension);
  if (!segment.complete) {
    expected += kPartSuffix;
  }
  if (segment.file.file != expected) {
    throw UsageError("segment " + std::to_string(segment.index) + " of " + segment.stream + " must be in " +
                     expected + ", not in " + segment.file.file);
  }
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(folder / expected, error);
  if (error || bytes != segment.file.bytes) {
    throw UsageError((folder / expected).string() +
                     " is not there as the entry would state it: commit it first");
  }
  const auto [last, is_first] = last_in_batch.try_emplace(segment.stream, segment.index);
  const bool follows = is_first ? !its_stream.last_index || *its_stream.last_index < segment.index
                                : last->second < segment.index;
  if (!follows) {
    throw UsageError("segment " + std::to_string(segment.index) + " of " + segment.stream +
                     " comes after a later one: segments are entered in order");
  }
  last->second = segment.index;
}

void CaseWriter::State::check_all(const std::vector<CaseEntryBody>& bodies) {
  std::map<std::string, std::uint64_t> last_in_batch;
  for (const CaseEntryBody& body : bodies) {
    if (stage == Stage::kClosed && !std::holds_alternative<TokenEntry>(body) &&
        !std::holds_alternative<TokenMissedEntry>(body) && !std::holds_alternative<ErasedEntry>(body)) {
      throw UsageError("case " + case_id + " is closed: only time-stamps and erasures can be added to it");
    }
    std::visit(Overloaded{[&](const SegmentEntry& segment) { check_segment(segment, last_in_batch); },
                          [&](const GapEntry& gap) { stream(gap.stream); },
                          [&](const ErasedEntry& erased) { stream(erased.stream); },
                          [](const OpenEntry&) { throw UsageError("`open` is written by create() alone"); },
                          [](const auto&) {}},
               body);
  }
}

void CaseWriter::State::write_entries(const std::vector<CaseEntryBody>& bodies, Moment now) {
  now.mono_ns = std::max(now.mono_ns, last_mono_ns);
  durably([&] {
    ledger->append([&](std::uint64_t size) {
      std::vector<std::string> lines;
      lines.reserve(bodies.size());
      for (const CaseEntryBody& body : bodies) {
        lines.push_back(to_line({size + lines.size(), now, body}));
      }
      return lines;
    });
  });
  last_mono_ns = now.mono_ns;
  for (const CaseEntryBody& body : bodies) {
    account_for(body);
  }
}

void CaseWriter::State::account_for(const CaseEntryBody& body) {
  if (const auto* segment = std::get_if<SegmentEntry>(&body)) {
    Stream& its_stream = stream(segment->stream);
    its_stream.last_index = segment->index;
    its_stream.total.segments += 1;
    its_stream.total.frames += segment->frames;
    its_stream.total.dropped += segment->dropped;
    its_stream.total.bytes += segment->file.bytes;
  } else if (const auto* token = std::get_if<TokenEntry>(&body)) {
    final_token = token->sha256;
  } else if (std::holds_alternative<CloseEntry>(body)) {
    stage = Stage::kClosed;
  }
}

void CaseWriter::State::check_authority(const std::string& authority) const {
  if (!is_short_name(authority)) {
    throw UsageError("an authority cannot be called \"" + authority +
                     "\": use up to 32 of a-z, 0-9 and '-', not '-' first");
  }
}

void CaseWriter::append(const std::vector<CaseEntryBody>& bodies, Moment now) {
  state_->refuse_unless_writable();
  for (const CaseEntryBody& body : bodies) {
    if (std::holds_alternative<CloseEntry>(body) || std::holds_alternative<TokenEntry>(body)) {
      throw UsageError("`close` is written by close(), `token` by add_token()");
    }
  }
  state_->check_all(bodies);
  state_->write_entries(bodies, now);
}

StoredCheckpoint CaseWriter::checkpoint(Moment now, bool log_it) {
  State& state = *state_;
  state.refuse_unless_writable();
  if (!state.last_checkpoint || state.last_checkpoint->size != state.ledger->size()) {
    StoredCheckpoint stored;
    stored.size = state.ledger->size();
    stored.root = state.ledger->root();
    const crypto::Checkpoint text{case_origin(state.device_name, state.case_id), stored.size, stored.root};
    stored.note = crypto::sign_note(text.to_text(), state.device_name, *state.key);
    stored.file = state.folder / note_path(stored.size);
    state.durably([&] { state.reserve.write_durably(stored.file, bytes_of(stored.note)); });
    state.last_checkpoint = std::move(stored);
  }
  const std::int64_t now_ns = std::max(now.mono_ns, state.last_mono_ns);
  if (state.log != nullptr &&
      (log_it || !state.last_logged_ns || now_ns - *state.last_logged_ns >= kLogIntervalNs)) {
    state.log->case_checkpoint(state.case_id, state.last_checkpoint->size, state.last_checkpoint->root);
    state.last_logged_ns = now_ns;
  }
  try {
    state.reserve.fill();
  } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): still full; asked again at the next checkpoint
  }
  return *state.last_checkpoint;
}

void CaseWriter::State::enter_token(std::uint64_t checkpoint, const std::string& authority,
                                    const crypto::Sha256Digest& sha256, const TokenEntry& facts, Moment now) {
  TokenEntry entry = facts;
  entry.checkpoint = checkpoint;
  entry.authority = authority;
  entry.file = token_path(checkpoint, authority);
  entry.sha256 = sha256;
  write_entries({entry}, now);
}

void CaseWriter::add_token(const StoredCheckpoint& over, const std::string& authority, ByteView response,
                           const TokenEntry& facts, Moment now) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(authority);
  const fs::path file = state.folder / token_path(over.size, authority);
  if (fs::exists(fs::symlink_status(file))) {
    throw UsageError("there is a token " + file.string() +
                     " already: one of each authority for a checkpoint");
  }
  state.durably([&] { state.reserve.write_durably(file, response); });
  state.enter_token(over.size, authority, crypto::sha256(response), facts, now);
}

void CaseWriter::adopt_token(std::uint64_t checkpoint, const std::string& authority, const TokenEntry& facts,
                             Moment now) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(authority);
  const FileOpening opening = CaseFolder::open(state.folder).open_file(token_path(checkpoint, authority));
  const std::optional<std::string> response =
      opening.file ? read_small(*opening.file, kMaximumTokenBytes) : std::nullopt;
  if (!response) {
    throw UsageError("there is no token " + token_path(checkpoint, authority) + " in case " + state.case_id);
  }
  state.enter_token(checkpoint, authority, crypto::sha256(bytes_of(*response)), facts, now);
}

void CaseWriter::store_authority_chain(const std::string& authority, const std::vector<Bytes>& chain_der) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(authority);
  std::string pem;
  for (const Bytes& der : chain_der) {
    pem += pem_of(der);
  }
  const fs::path file = state.folder / kAuthoritiesFolder / (authority + ".pem");
  state.durably([&] { state.reserve.write_durably(file, bytes_of(pem)); });
}

void CaseWriter::close(const std::string& reason, Moment now) {
  state_->refuse_unless_writable();
  CloseEntry close;
  close.reason = reason;
  for (const State::Stream& stream : state_->streams) {
    close.totals[stream.info.name] = stream.total;
  }
  state_->check_all({close});
  state_->write_entries({close}, now);
}

StoredCheckpoint CaseWriter::finish(Moment now) {
  State& state = *state_;
  if (state.stage == State::Stage::kRecording) {
    throw UsageError("case " + state.case_id + " must be closed before it is finished");
  }
  // A case that was finished before, and erased from since, is closed in the log already.
  const bool known =
      state.log != nullptr && state.log->case_state(state.case_id) == ApplianceLog::CaseState::kClosed;
  StoredCheckpoint last = checkpoint(now, known);
  if (state.log != nullptr && !known) {
    state.log->case_closed(state.case_id, last.size, last.root, state.final_token);
  }
  state.stage = State::Stage::kFinished;
  state.ledger->trim();
  return last;
}

}  // namespace kiroku::archive

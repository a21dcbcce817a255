#include "archive/writing/case_writer.h"

#include "archive/format/case_folder.h"
#include "archive/format/segment_media.h"
#include "archive/verify/token_rules.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer_state.h"
#include "archive/writing/ledger.h"
#include "crypto/encoding.h"
#include "evidence/shared_token.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kLogIntervalNs = 60'000'000'000;
constexpr std::size_t kPemColumns = 64;  // RFC 7468 section 2

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

CaseWriter::CaseWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
CaseWriter::~CaseWriter() = default;

const std::string& CaseWriter::case_id() const { return state_->case_id; }
const fs::path& CaseWriter::folder() const { return state_->folder; }
std::uint64_t CaseWriter::size() const { return state_->ledger->size(); }
std::uint64_t CaseWriter::covered() const {
  return state_->last_checkpoint ? state_->last_checkpoint->size : 0;
}
std::uint64_t CaseWriter::torn_bytes() const { return state_->torn_bytes; }
std::uint64_t CaseWriter::unsigned_bytes() const { return state_->unsigned_bytes; }
bool CaseWriter::opening_vouched() const { return state_->opening_vouched; }
bool CaseWriter::rests_on_hardware() const { return state_->rests_on_hardware; }

std::unique_ptr<SegmentWriter> CaseWriter::begin_segment(std::size_t stream_index,
                                                         std::uint64_t segment_index,
                                                         const std::string& profile) {
  const State::Stream& stream = state_->streams.at(stream_index);
  if (stream.recipients.empty()) {
    throw UsageError("case " + state_->case_id +
                     " was taken up again to be brought to its end: nothing more is recorded in it");
  }
  SegmentEntry begun;
  begun.index = segment_index;
  begun.profile = profile;
  const std::string relative = file_of(stream.info, begun);
  const fs::path path = state_->folder / relative;
  if (state_->files.exists(path)) {
    throw UsageError("there is a segment " + path.string() + " already: segments are written once");
  }
  return std::make_unique<SegmentWriter>(state_->files, path, relative, stream.recipients);
}

void CaseWriter::take_in(SegmentEntry& segment, const fs::path& from) {
  State& state = *state_;
  state.refuse_unless_writable();
  const std::string relative = file_of(state.stream(segment.stream).info, segment);
  const fs::path target = state.folder / relative;
  if (state.files.exists(target)) {
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
  const std::string expected = file_of(its_stream.info, segment);
  if (segment.file.file != expected) {
    throw UsageError("segment " + std::to_string(segment.index) + " of " + segment.stream + " must be in " +
                     expected + ", not in " + segment.file.file);
  }
  const std::optional<FileStatus> found = files.status(folder / expected);
  if (!found || found->kind != FileStatus::Kind::kRegular || found->bytes != segment.file.bytes) {
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
    stored.note =
        crypto::sign_note_by_all(text.to_text(), state.device_name, *state.key, state.ask_hardware).note;
    stored.file = state.folder / note_path(stored.size);
    state.durably([&] { state.reserve.write_durably(stored.file, bytes_of(stored.note)); });
    state.last_checkpoint = std::move(stored);
  }
  const std::int64_t now_ns = std::max(now.mono_ns, state.last_mono_ns);
  if (state.log != nullptr &&
      (log_it || !state.last_logged_ns || now_ns - *state.last_logged_ns >= kLogIntervalNs)) {
    try {
      state.log->case_checkpoint(state.case_id, state.last_checkpoint->size, state.last_checkpoint->root);
      state.last_logged_ns = now_ns;
    } catch (const LedgerHeldError&) {
      // Whoever locks the log must not end what is recorded: the next checkpoint is entered.
      if (log_it) {
        throw;
      }
    }
  }
  try {
    state.reserve.fill();
  } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): still full; asked again at the next checkpoint
  }
  return *state.last_checkpoint;
}

void CaseWriter::State::enter_token(const TokenName& name, const crypto::Sha256Digest& sha256,
                                    const TokenEntry& facts, Moment now) {
  TokenEntry entry = facts;
  entry.checkpoint = name.size;
  entry.authority = name.authority;
  entry.file = token_path(name.size, name.authority, name.form);
  entry.sha256 = sha256;
  write_entries({entry}, now);
}

std::optional<TokenMissedEntry> CaseWriter::token_in_the_way(std::uint64_t checkpoint,
                                                             const std::string& authority) const {
  for (const TokenForm form : {TokenForm::kResponse, TokenForm::kShared}) {
    const std::string file = token_path(checkpoint, authority, form);
    std::error_code error;
    if (fs::exists(fs::symlink_status(state_->folder / file, error))) {
      return TokenMissedEntry{checkpoint, authority,
                              "a token came, and something else lay in " + file +
                                  " already, which the recorder did not put there and leaves as it is"};
    }
  }
  return std::nullopt;
}

void CaseWriter::add_token(const StoredCheckpoint& over, const std::string& authority, ByteView response,
                           const TokenEntry& facts, Moment now) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(authority);
  for (const TokenForm form : {TokenForm::kResponse, TokenForm::kShared}) {
    const fs::path there = state.folder / token_path(over.size, authority, form);
    if (state.files.exists(there)) {
      throw UsageError("there is a token " + there.string() +
                       " already: one of each authority for a checkpoint");
    }
  }
  const TokenForm form = evidence::begins_as_record(response) ? TokenForm::kShared : TokenForm::kResponse;
  const TokenName name{over.size, authority, form};
  const fs::path file = state.folder / token_path(name.size, name.authority, name.form);
  state.durably([&] { state.reserve.write_durably(file, response); });
  state.enter_token(name, crypto::sha256(response), facts, now);
}

void CaseWriter::adopt_token(const TokenName& name, const TokenEntry& facts, Moment now) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(name.authority);
  const std::string file = token_path(name.size, name.authority, name.form);
  const auto response = CaseFolder::open(state.folder, state.files).read_if_there(file, kMaximumTokenBytes);
  if (!response) {
    throw UsageError("there is no token " + file + " in case " + state.case_id);
  }
  state.enter_token(name, crypto::sha256(bytes_of(*response)), facts, now);
}

void CaseWriter::store_authority_chain(const std::string& authority, const std::vector<Bytes>& chain_der) {
  State& state = *state_;
  state.refuse_unless_writable();
  state.check_authority(authority);
  if (chain_der.empty()) {
    return;  // an empty file would be no certificates
  }
  std::string pem;
  for (const Bytes& der : chain_der) {
    pem += pem_of(der);
  }
  const fs::path file = state.folder / kAuthoritiesFolder / (authority + ".pem");
  // The same with each token: what was written again would have to be copied to every replica and store
  // again.
  std::string& written = state.chains[authority];
  if (written == pem) return;
  state.durably([&] { state.reserve.write_durably(file, bytes_of(pem)); });
  written = std::move(pem);
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

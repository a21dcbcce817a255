#include <array>
#include <set>

#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer_state.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

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
    if (files_.exists(final_path_)) {
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
  if (options.subject && options.sealed_subject) {
    throw UsageError("a case has one subject: it is given, or carried over from another case");
  }
  if (!options.case_id.empty() && !is_case_id(options.case_id)) {
    throw UsageError("\"" + options.case_id + "\" is no case identifier");
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
    if (options.carries_on && is_events(streams[i])) {
      streams[i].source = source_carrying_on(*options.carries_on);
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

FileReference store_sealed_subject(FileSystem& files, const fs::path& folder, ByteView sealed) {
  files.write_durably(folder / kSubjectFile, sealed);
  return {std::string(kSubjectFile), sealed.size(), crypto::sha256(sealed)};
}

FileReference store_subject(FileSystem& files, const fs::path& folder, ByteView subject,
                            const crypto::AgeRecipients& recipients) {
  return store_sealed_subject(files, folder, crypto::seal_bytes(subject, recipients));
}

}  // namespace

std::string new_case_id(UtcTime now) {
  std::array<std::byte, 4> random{};
  crypto::fill_random(random);
  return format_utc_compact(now) + "-" + crypto::to_hex(random);
}

// Under the hidden name: folders, subject, device key, ledger with `open`, each durable; then
//
//   rename(.new-ID, ID)   fsync(archive)   → the case exists   → case-opened in the appliance log
//
std::unique_ptr<CaseWriter> CaseWriter::create(FileSystem& files, const Options& options, Moment now) {
  check(options);
  auto state = std::make_unique<State>(files, options.key, options.device_name, options.log, options.archive);
  state->reserve.fill();
  state->case_id = options.case_id.empty() ? new_case_id(now.utc) : options.case_id;
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
  if (options.sealed_subject) {
    open.subject = store_sealed_subject(files, folder.path(), *options.sealed_subject);
  } else if (options.subject) {
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

}  // namespace kiroku::archive

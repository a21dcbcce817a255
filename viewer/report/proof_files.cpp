#include "viewer/report/proof_files.h"

#include <algorithm>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/reading/log_proving.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/found_files.h"
#include "base/error.h"
#include "timestamp/certificate_text.h"
#include "timestamp/token.h"
#include "viewer/report/pdf_writer.h"
#include "viewer/report/texts.h"

namespace kiroku::report {
namespace {

constexpr std::size_t kMostBytesOfFile = std::size_t{1} << 20U;
constexpr std::string_view kNote = "text/plain", kToken = "application/timestamp-reply",
                           kCertificates = "application/x-pem-file", kPdf = "application/pdf",
                           // IANA has no type for RFC 4998's records.
    kRecord = "application/octet-stream";

class ProofFiles {
 public:
  ProofFiles(const std::filesystem::path& folder, const ReportInput& input)
      : folder_(archive::CaseFolder::open(folder)), in_(input) {}

  void add_last_checkpoint() {
    if (!in_.facts.last_checkpoint) return;
    const StoredNote& note = *in_.facts.last_checkpoint;
    add(note.file, kNote, "attached.checkpoint", to_bytes(note.text));
  }

  void add_tokens() {
    const std::vector<const StatedToken*> relied = relied_on();
    for (std::size_t i = 0; i < relied.size(); ++i) {
      if (i >= kMostTokens / 2 && i + kMostTokens / 2 < relied.size()) continue;
      add_token(relied[i]->token);
    }
  }

  /// The record that was judged: what lies there since, anybody can have put there.
  void add_evidence_record(const std::filesystem::path& file, const crypto::Sha256Digest& judged) {
    try {
      auto record = archive::read_evidence_file(archive::real_reading(), file);
      if (record && crypto::sha256(*record) == judged)
        add("evidence-record.ers", kRecord, "attached.record", std::move(*record));
    } catch (const Error&) {
      return;  // the document says what was found when it was judged
    }
  }

  /// Under its bare name: readers of PDF refuse to save what has a folder in its name. `path`: in the case's
  /// folder.
  void add(const std::string& path, std::string_view media_type, TextKey description, Bytes bytes) {
    const std::string name = std::filesystem::path(path).filename().string();
    if (!names_.insert(name).second) return;
    files_.push_back({name, std::string(media_type), say(in_.language, description), std::move(bytes)});
  }

  std::vector<Attachment> take() { return std::move(files_); }

 private:
  /// As in the report: outside authorities' where there are any, else the recorder's own.
  [[nodiscard]] std::vector<const StatedToken*> relied_on() const {
    std::vector<const StatedToken*> outside, own;
    for (const StatedToken& stated : in_.facts.tokens) {
      const auto& all = in_.verification.proving_tokens;
      const auto its = std::ranges::lower_bound(all, stated.entry, {}, &archive::ProvingToken::entry);
      if (its != all.end() && its->entry == stated.entry) (its->outside ? outside : own).push_back(&stated);
    }
    return outside.empty() ? own : outside;
  }

  [[nodiscard]] std::optional<std::string> read(const std::string& name) const {
    try {
      const archive::FileOpening opening = folder_.open_file(name);
      return opening.file ? archive::read_small(*opening.file, kMostBytesOfFile) : std::nullopt;
    } catch (const IoError&) {
      return std::nullopt;
    }
  }

  /// A token that is still what was verified, and the checkpoint that it is over.
  void add_token(const archive::TokenEntry& token) {
    const std::string note = archive::note_path(token.checkpoint);
    const std::optional<std::string> answer = read(token.file), text = read(note);
    if (!answer || !text || crypto::sha256(bytes_of(*answer)) != token.sha256) return;
    const auto name = archive::token_of_path(token.file);
    if (!name) return;
    std::string explanation;
    const auto judging = archive::judging_of(name->form, bytes_of(*answer), bytes_of(*text), explanation);
    const auto response = judging ? timestamp::parse_response(judging->token, explanation) : std::nullopt;
    const auto info = response ? timestamp::parse_token_info(response->token, explanation) : std::nullopt;
    if (!info || !judging->is_over_data(*info)) return;
    add(note, kNote, "attached.checkpoint", to_bytes(*text));
    add(token.file, kToken, "attached.token", to_bytes(*answer));
    const std::string chain = std::string(archive::kAuthoritiesFolder) + "/" + token.authority + ".pem";
    const std::optional<std::string> pem = read(chain);
    // Nobody signs these files: text beside the certificates would be somebody's, in the report's name.
    if (pem && timestamp::is_certificate_text(*pem))
      add(chain, kCertificates, "attached.chain", to_bytes(*pem));
  }

  archive::CaseFolder folder_;
  const ReportInput& in_;
  std::set<std::string> names_;
  std::vector<Attachment> files_;
};

}  // namespace

std::vector<Attachment> read_proof_files(const std::filesystem::path& folder, const ReportInput& input,
                                         const std::optional<std::filesystem::path>& evidence_record) {
  ProofFiles files(folder, input);
  files.add_last_checkpoint();
  files.add_tokens();
  if (evidence_record && input.verification.evidence && input.verification.evidence->holds) {
    files.add_evidence_record(*evidence_record, input.verification.evidence->sha256);
  }
  if (input.facts.last_checkpoint && !input.facts.excerpt)
    files.add("receipt.pdf", kPdf, "attached.receipt", write_pdf(make_receipt(input)));
  return files.take();
}

std::optional<Attachment> log_proof_file(const std::filesystem::path& folder, const ReportInput& input,
                                         const std::optional<archive::OutsideNote>& given,
                                         const std::optional<ComparedLog>& log) {
  const auto carry = [&](std::string_view text) {
    return Attachment{std::string(kLogProofFile), std::string(kNote),
                      say(input.language, "attached.log-proof"), to_bytes(text)};
  };
  const archive::VerificationReport& found = input.verification;
  if (given) return found.proved_entries > 0 ? std::optional(carry(given->text)) : std::nullopt;
  if (!log || input.facts.excerpt || !found.in_log || !found.in_log->end) return std::nullopt;
  try {
    const archive::MadeLogProof made = archive::prove_case_in_log(
        folder, log->folder, log->device, log->kept, [&](const std::string& /*case_id*/) { return folder; });
    // The folder was opened anew: another genuine case may lie there since.
    return made.case_id == found.case_id ? std::optional(carry(made.proof.to_text())) : std::nullopt;
  } catch (const Error&) {
    return std::nullopt;  // the document says what the log was found to know
  }
}

std::vector<Attachment> receipt_files(const ReportInput& input, const std::optional<Attachment>& log_proof) {
  if (!input.facts.last_checkpoint || input.facts.excerpt) return {};
  const StoredNote& note = *input.facts.last_checkpoint;
  std::vector<Attachment> files{{std::filesystem::path(note.file).filename().string(), std::string(kNote),
                                 say(input.language, "attached.checkpoint"), to_bytes(note.text)}};
  if (log_proof) files.push_back(*log_proof);
  return files;
}

}  // namespace kiroku::report

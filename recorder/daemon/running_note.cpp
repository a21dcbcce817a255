#include "recorder/daemon/running_note.h"

#include <cstdint>
#include <fstream>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"

namespace kiroku::recorder {
namespace {

using nlohmann::json;

/// What the device signs: no checkpoint, whose second line is a number.
std::string signed_text(const NewestSubject& subject) {
  return "kiroku newest subject\n" + subject.case_id + "\n" + crypto::to_hex(crypto::sha256(subject.sealed)) +
         "\n";
}

/// What cannot be read is not taken for no subject: then the one before it, which it corrected, would count.
NewestSubject read_subject(const json& noted, const std::string& case_id) {
  const auto text = [&](const char* key) {
    const auto found = noted.is_object() ? noted.find(key) : noted.end();
    return found != noted.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  NewestSubject subject{text("case"), {}, {}};
  if (!archive::is_case_id(subject.case_id)) return {case_id, {}, {}};
  const auto sealed = crypto::from_base64(text("sealed"), crypto::Base64Padding::kPadded);
  const auto signature = crypto::from_base64(text("signature"), crypto::Base64Padding::kPadded);
  if (!sealed || !signature) return subject;
  subject.sealed = *sealed;
  subject.signature = *signature;
  return subject;
}

std::optional<RunningCase> read_note(const std::filesystem::path& file) {
  std::ifstream in(file);
  const json note = json::parse(in, nullptr, false);
  if (!note.is_object()) return {};
  const auto text = [&](const char* key) {
    const auto found = note.find(key);
    return found != note.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  RunningCase running{text("case"), text("carries_on"), text("reason"), true};
  if (!archive::is_case_id(running.case_id)) return {};
  if (!archive::is_case_id(running.carries_on)) running.carries_on.clear();
  // What cannot be read is not taken for leave to record.
  if (const auto ending = note.find("ending"); ending != note.end() && ending->is_boolean()) {
    running.ending = ending->get<bool>();
  }
  if (const auto subject = note.find("subject"); subject != note.end()) {
    running.subject = read_subject(*subject, running.case_id);
  }
  if (const auto suspended = note.find("suspended_ns");
      suspended != note.end() && suspended->is_number_integer()) {
    running.suspended = std::chrono::nanoseconds(suspended->get<std::int64_t>());
  }
  return running;
}

}  // namespace

NewestSubject sign_newest_subject(std::string case_id, Bytes sealed, const crypto::SigningKey& key) {
  NewestSubject subject{std::move(case_id), std::move(sealed), {}};
  const crypto::Ed25519Signature signature = key.sign(bytes_of(signed_text(subject)));
  subject.signature = to_bytes(signature);
  return subject;
}

bool is_signed(const NewestSubject& subject, const crypto::Ed25519PublicKey& key) {
  return crypto::verify_ed25519(key, bytes_of(signed_text(subject)), subject.signature);
}

RunningNote::RunningNote(archive::FileSystem& files, const std::filesystem::path& archive, std::string room)
    : files_(files), file_(archive / ".running" / (std::move(room) + ".json")) {}

std::optional<RunningCase> RunningNote::read() const {
  const std::lock_guard guard(mutex_);
  return read_note(file_);
}

void RunningNote::write(const RunningCase& running) {
  if (!std::filesystem::exists(file_.parent_path())) {
    files_.make_folder(file_.parent_path());
    files_.sync_folder(file_.parent_path().parent_path());
  }
  json note{{"case", running.case_id},
            {"carries_on", running.carries_on},
            {"reason", running.reason},
            {"ending", running.ending}};
  if (const auto& subject = running.subject) {
    note["subject"] = {{"case", subject->case_id},
                       {"sealed", crypto::to_base64(subject->sealed, crypto::Base64Padding::kPadded)},
                       {"signature", crypto::to_base64(subject->signature, crypto::Base64Padding::kPadded)}};
  }
  if (running.suspended) note["suspended_ns"] = running.suspended->count();
  files_.write_durably(file_, bytes_of(note.dump() + "\n"));
}

void RunningNote::begins(const RunningCase& running) {
  const std::lock_guard guard(mutex_);
  RunningCase noted = running;
  if (const auto before = read_note(file_); before && before->subject && !running.carries_on.empty() &&
                                            before->subject->case_id == running.carries_on) {
    noted.subject = before->subject;
  }
  write(noted);
}

void RunningNote::newest_subject(const NewestSubject& subject) {
  const std::lock_guard guard(mutex_);
  std::optional<RunningCase> running = read_note(file_);
  if (!running || running->case_id != subject.case_id) return;
  running->subject = subject;
  write(*running);
}

void RunningNote::ends(const std::string& case_id) {
  const std::lock_guard guard(mutex_);
  std::optional<RunningCase> running = read_note(file_);
  if (!running || running->case_id != case_id || running->ending) return;
  running->ending = true;
  write(*running);
}

void RunningNote::clear(const std::string& case_id) {
  const std::lock_guard guard(mutex_);
  const std::optional<RunningCase> running = read_note(file_);
  if (!running || running->case_id != case_id) return;
  files_.remove(file_);
  files_.sync_folder(file_.parent_path());
}

}  // namespace kiroku::recorder

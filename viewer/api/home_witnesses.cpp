#include "viewer/api/home_witnesses.h"

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "base/error.h"

namespace kiroku::viewer {

HomeWitnesses::HomeWitnesses(const std::filesystem::path& folder, const crypto::VerifierKey& device) {
  constexpr std::size_t kLargestPolicy = 1U << 20;
  if (folder.empty()) return;
  try {
    const archive::CaseFolder home = archive::CaseFolder::open(folder);
    const std::optional<std::string> policy = home.read_if_there("witnesses.txt", kLargestPolicy);
    if (!policy) return;
    policy_ = crypto::WitnessPolicy::parse(*policy, "witnesses.txt");
    std::optional<std::string> note = home.read_if_there("witnessed/log.note", archive::kMaximumNoteBytes);
    if (!note) return;
    // What else lies there says nothing of this log, and nothing against a case.
    const crypto::OpenedNote opened = crypto::open_note(*note, {device});
    const auto checkpoint = crypto::Checkpoint::parse(opened.text);
    if (checkpoint && checkpoint->size > 0 && checkpoint->origin == archive::log_origin(device.name()) &&
        crypto::is_signed_for_log(opened, device, checkpoint->size)) {
      note_ = {"witnessed/log.note", std::move(*note)};
    }
  } catch (const Error& error) {
    problem_ = error.what();
  }
}

void HomeWitnesses::ask_in(archive::VerifyOptions& options) const {
  if (!policy_) return;
  options.witnesses = &*policy_;
  if (note_) options.against.push_back(*note_);
}

void HomeWitnesses::say(archive::VerificationReport& report) const {
  if (problem_.empty()) return;
  if (!report.witnesses) report.witnesses.emplace();
  report.witnesses->unused.push_back(problem_);
}

}  // namespace kiroku::viewer

#include "apps/sim/comparison_sealing.h"

#include <filesystem>

#include "apps/common/version.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/user_name.h"
#include "apps/sim/comparison_outputs.h"
#include "apps/sim/number_option.h"
#include "base/descriptor.h"
#include "crypto/remote_identity.h"
#include "viewer/kept/log_of_case.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

compare::NamedFile named(const SealedFile& file) { return {file.role, file.name, file.bytes, file.sha256}; }

compare::Provenance provenance_of(const ComparisonRequest& request, const archive::CaseReader& recording,
                                  const FilesAtHand& at_hand, std::optional<compare::ComparedCt> ct,
                                  const PatientNumbers& numbers) {
  compare::Provenance made;
  made.made_by = request.made_by.value_or(user_name());
  made.made_at = std::chrono::floor<std::chrono::microseconds>(std::chrono::system_clock::now());
  made.program = std::string("kiroku ") + kVersion;
  made.case_state = compare::state_of(recording.folder());
  made.plan = at_hand.files.plan;
  made.plan_seal = at_hand.seal;
  made.plan_sealed = at_hand.sealed;
  for (const SealedFile& file : at_hand.files.files) made.plan_files.push_back(named(file));
  if (recording.opening().plan) made.case_names_plan = *recording.opening().plan == at_hand.seal;
  made.ct = std::move(ct);
  made.of_one_patient = are_of_one_patient(numbers.ct, numbers.of_case);
  return made;
}

crypto::AgeIdentities identities_of(const ComparisonRequest& request, const std::optional<Home>& home) {
  if (!request.identity_socket) return load_identities(request.identities, home);
  const double number = parse_number(*request.identity_socket, "--identity-socket", 3, 1 << 20);
  return {crypto::remote_identity(Descriptor(static_cast<int>(number)))};
}

std::vector<Stamp> seal_document(const ComparisonRequest& request, const Home& home,
                                 const std::string& case_id, const fs::path& document,
                                 const crypto::Sha256Digest& digest) {
  const Authorities authorities(home, home.configuration(), request.authorities);
  const WritableHome writable(home);
  // Where a program makes it for a person, this machine's user alone would say little.
  const std::string who = user_name() + (request.asked_by ? " for " + *request.asked_by : "");
  writable.log->access(case_id, compare::comparison_deed(digest), who);
  std::vector<Stamp> stamps;
  for (const recorder::NamedAuthority& authority : authorities.named()) {
    stamps.push_back(stamp_file(authority, document, digest, writable.trust));
  }
  return stamps;
}

MadeComparison write_sealed(const ComparisonRequest& request, const std::optional<Home>& home,
                            const archive::CaseReader& recording, const std::string& text) {
  MadeComparison made;
  made.digest = crypto::sha256(bytes_of(text));
  made.document = document_of(*request.output);
  remove_tokens(made.document);
  write_output(made.document, bytes_of(text), request.force);
  made.in_log = home && home->holds(recording.folder());
  if (made.in_log)
    made.stamps = seal_document(request, *home, recording.opening().case_id, made.document, made.digest);
  return made;
}

}  // namespace kiroku::apps

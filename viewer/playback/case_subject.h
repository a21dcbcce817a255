// What a case is about: patient, procedure and staff, which are sealed (docs/reference/format-streams.md,
// "The subject file"). Functions; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "viewer/playback/case_media.h"

namespace kiroku::playback {

struct CasePerson {
  std::string role, name, id;
};

/// As it was sealed once. Whatever is not known is empty. Texts are UTF-8 as they were sealed: whoever shows
/// them must expect characters that mislead (base/printable.h).
struct CaseSubject {
  /// When it became known while the case ran, on the case clock; nothing: it was sealed with the beginning.
  std::optional<std::int64_t> time_ns;
  /// A name that was sent in several scripts has each of them, " / " between them.
  std::string patient, patient_id, birth_date, sex;
  std::string procedure, procedure_code, procedure_id, planned;
  std::vector<CasePerson> staff;
  std::string origin, chosen;  // who said so, and why these data
  /// Every text of it in lower case (base/ascii.h), for searching.
  std::string searchable;
};

/// The subject file first, then what came while the case ran, in order of time; the last one is what stood at
/// the end. None where nothing was sealed. Throws kiroku::Error in a sentence, which has nothing of the
/// content: a file that is not what the ledger says, or that is no JSON object; crypto::AgeError (kNoMatch)
/// where the identities open none of it.
std::vector<CaseSubject> subjects_of(const CaseMedia& media);

/// Of the JSON text of a subject file: anything that a person may have given, so nothing is taken for
/// granted but that it is an object. Nothing for any other text.
std::optional<CaseSubject> read_subject(std::string_view json);

}  // namespace kiroku::playback

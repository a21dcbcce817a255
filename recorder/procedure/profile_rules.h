// In which form a procedure's pictures are archived, by what is known of it (docs/how-to/record.md, "The
// profile follows the procedure"). Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "recorder/encoder/video_profile.h"

namespace kiroku::recorder {

/// One [[recording.profile_for]].
struct ProfileRule {
  std::string name;  // shown where it chose; tells nothing of a patient
  std::vector<std::string> words, codes;
  Profile profile = Profile::kMpeg2;
  std::vector<std::string> streams;  // none: all of pictures
};

struct ProfileChoice {
  ProfileRule rule;
  std::string why;  // "the word 'EMR' in 'EMR of the stomach'": of the patient's procedure, to be sealed
};

/// Whether `word` stands in `text`, whatever the case, the width and the composition of its letters (Unicode
/// TR 15, NFKC, and case folding); blanks and line ends count as one blank. A word of letters that stands
/// among other letters or digits of such a script is another word ("EMR" is not in "EMRX"); Chinese and
/// Japanese, which write without blanks, are found everywhere. Bytes that are no UTF-8 are no letters.
bool has_word(std::string_view text, std::string_view word);

/// The first rule of which a code is the procedure's code, or a word stands in its description. `subject` is
/// a subject's JSON (docs/reference/format-streams.md, "The subject file"): "procedure" is a text, or an
/// object with "description" and "code". Nothing where no rule matches, or nothing is said of a procedure.
std::optional<ProfileChoice> choose_profile(const std::vector<ProfileRule>& rules, const Bytes& subject);

}  // namespace kiroku::recorder

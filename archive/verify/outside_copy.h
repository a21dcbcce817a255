// Earlier copies of a case or a log as what they are: folders that somebody else may have filled. Functions;
// thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/verify/verify_options.h"

namespace kiroku::archive {

/// Nothing is judged here. Throws kiroku::UsageError where no file lies in a checkpoint's place, and
/// kiroku::Error where the folder or one of these files cannot be read.
OutsideCopy read_outside_copy(const std::filesystem::path& folder);

/// The text of one of its notes; nothing where the file is another by now.
std::optional<std::string> text_of_note(const OutsideCopy& copy, const OutsideCopy::Note& note);

/// Whether the origin is one of a ledger that the device signs: its log's, or that of one of its cases.
bool is_origin_of(const std::string& origin, const crypto::VerifierKey& device);

/// Of its notes the one over the most entries that one of these devices signed for a log or a case of its
/// own.
std::optional<OutsideNote> newest_signed_note(const OutsideCopy& copy,
                                              const std::vector<crypto::VerifierKey>& devices);

/// What else lies beside the notes, as half a sentence behind one; "" where nothing does.
std::string words_of_others(const OutsideCopy& copy);

}  // namespace kiroku::archive

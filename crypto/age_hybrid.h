// The post-quantum recipient type of age (C2SP age, "mlkem768x25519"): HPKE over X-Wing. What is sealed to it
// today stays closed to a quantum computer of tomorrow, which matters for archives that are kept for decades
// and could be copied now. Opened by age from version 1.3 on, not by Debian's (1.1 in 12, 1.2 in 13). A file
// must not be sealed to other recipient types beside it, through which it would open all the same.
//
// Texts are "age1pq1…" and "AGE-SECRET-KEY-PQ-1…"; parse_recipient and parse_identity take them, too.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "crypto/age_recipient.h"

namespace kiroku::crypto {

bool is_hybrid_recipient_text(std::string_view text);
bool is_hybrid_identity_text(std::string_view text);

/// Throws kiroku::UsageError naming the text if it is none.
std::shared_ptr<const AgeRecipient> parse_hybrid_recipient(std::string_view text);
/// Throws kiroku::UsageError, without repeating the text.
std::shared_ptr<const AgeIdentity> parse_hybrid_identity(std::string_view text);

AgeKeyPair generate_hybrid_age_key();
std::string hybrid_recipient_of(std::string_view identity_text);

}  // namespace kiroku::crypto

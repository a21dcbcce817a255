// Time-stamps for evidence records: of the authorities that recording asks, in their order.
#pragma once

#include <vector>

#include "evidence/renewal.h"
#include "recorder/authority_contact.h"

namespace kiroku::recorder {

/// The first valid token of an outside authority, as their judgement under `trust` says. One of the
/// recorder's own is taken only where all others answered and none of them is an outside one: a record with a
/// single time-stamp of its own authority is self-issued for good. An authority that is to be left alone for
/// up to two minutes is waited for; longer, it is passed over. The function throws kiroku::Error with what
/// each authority said where no token is taken. What is referred to must outlive it; `queue` may be null. Not
/// thread-safe.
evidence::Stamp record_stamper(const std::vector<NamedAuthority>& authorities,
                               const timestamp::TrustStore* trust, StampingQueue* queue,
                               const Clock& clock = Clock::system());

}  // namespace kiroku::recorder

// An identity that another process holds and does not give away: it is asked for file keys over a stream
// socket.
//
//   question   length (4 bytes, most significant first) and an age header with the stanzas, whose MAC is
//   under
//              a key of zeros: the real one is what is asked for
//   answer     one byte: 1 with the file key behind it, or 0
#pragma once

#include <memory>

#include "base/descriptor.h"
#include "crypto/age_recipient.h"

namespace kiroku::crypto {

/// Who asks. Thread-safe: one question at a time. unwrap() throws kiroku::Error where nobody answers any
/// more.
std::shared_ptr<const AgeIdentity> remote_identity(Descriptor socket);

/// Who answers, until the other side closes the socket or asks what is no question. A stanza that one of the
/// identities finds malformed is answered by the others.
void answer_for(const AgeIdentities& identities, int socket);

}  // namespace kiroku::crypto

// What may lie as `authorities/<authority>.pem` in a case: certificates and nothing beside them. Pure
// functions, thread-safe.
#pragma once

#include <string_view>

namespace kiroku::timestamp {

/// Whether `pem` is one or several blocks CERTIFICATE or X509 CRL (RFC 7468, strict form: LF, no text before,
/// between or after them), each with the DER of exactly that. Whether they are valid or trusted is not
/// judged.
bool is_certificate_text(std::string_view pem);

}  // namespace kiroku::timestamp

// What every TLS server of Kiroku speaks: TLS 1.2 and 1.3 (RFC 8446), forward secrecy, no tickets, no
// renegotiation. Brings Asio.
#pragma once

#include <string>

#include <boost/asio/ssl/context.hpp>

#include "base/bytes.h"

namespace kiroku::http {

/// `certificate_pem`: the server's, then those up to its authority. Throws kiroku::UsageError where the two
/// cannot be used.
boost::asio::ssl::context server_tls(const std::string& certificate_pem, ByteView key_pem);
/// The same, which asks clients for a certificate. One that this authority did not issue for clients, or that
/// is over, ends the handshake; none is let in.
boost::asio::ssl::context server_tls(const std::string& certificate_pem, ByteView key_pem,
                                     const std::string& client_authority_pem);

}  // namespace kiroku::http

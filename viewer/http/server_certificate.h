// The server's own certificate, for a home that was given none: self-signed, P-256, for the names of this
// machine. Functions are thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "crypto/secret.h"

namespace kiroku::viewer {

struct ServerCertificate {
  std::string certificate_pem;  // the server's, then those up to its authority
  crypto::Secret key_pem;
};

/// SHA-256 of the first certificate as people compare it: "3F:9C:…". Throws kiroku::UsageError for what is no
/// PEM certificate.
std::string fingerprint(const std::string& certificate_pem);

/// Both from files that somebody gave. Throws kiroku::UsageError for a key with a passphrase.
ServerCertificate load_certificate(const std::filesystem::path& certificate,
                                   const std::filesystem::path& key);

/// Those of `folder` (viewer.pem, and viewer.key with mode 0600), made there where they are missing, do not
/// belong together, lack one of `names` (DNS names or addresses) or end within 30 days. Says in `made`
/// whether they are new. Of several programs that come at once one makes them (viewer.lock).
ServerCertificate own_certificate(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                  bool& made);

/// What this machine is called, and the addresses of the loopback: "or-3", "or-3.hospital.example",
/// "localhost", "127.0.0.1", "::1".
std::vector<std::string> machine_names();

}  // namespace kiroku::viewer

// The hospital's own small authority, by which appliances show who they are when they report: requests for
// certificates (PKCS #10, RFC 2986), certificates (RFC 5280), and the code by which an administrator knows a
// request. P-256 keys, ECDSA with SHA-256. Functions are thread-safe; objects are immutable, and so are they.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "base/bytes.h"
#include "base/utc_time.h"
#include "crypto/secret.h"

namespace kiroku::fleet {

/// The name in every report server's certificate. Appliances ask for it, whatever the address: this authority
/// issues certificates of servers to nobody else.
inline constexpr const char* kReportServerName = "kiroku-fleet";

/// A new key, PEM (PKCS #8), and a request for a certificate of it, PEM.
struct CertificateRequest {
  crypto::Secret key_pem;
  std::string request_pem;
};
/// Throws kiroku::UsageError for a name that is no short one (archive::is_short_name), kiroku::Error.
CertificateRequest make_certificate_request(const std::string& appliance);

/// The appliance that the request names. Throws kiroku::UsageError for what is no request of at most 4 KiB
/// for one short name and a P-256 key, signed by that key.
std::string appliance_of_request(std::string_view request_pem);
/// The request alone, without what stands before and behind it in the text: that may be anything, such as a
/// zero byte, at which a database ends a text. Throws as appliance_of_request().
std::string request_alone(std::string_view request_pem);
/// SHA-256 of the request's DER, as people compare it: "9F:86:D0:…".
std::string request_fingerprint(std::string_view request_pem);

/// What the appliance shows and the administrator enters: "K7QM-2XFA-9DTR-PHW4", 80 bits over the request,
/// the authority's certificate and the server's nonce. The server draws the nonce after it has the request.
/// So whoever stands between the two, and would put a request or an authority of their own in, has to find a
/// second preimage of 80 bits while the administrator types.
std::string enrolment_code(std::string_view request_pem, std::string_view authority_pem,
                           std::string_view nonce);
/// As enrolment_code() writes it: small letters, blanks and missing hyphens are taken, and so are O for 0 and
/// I or L for 1. "" for what is no such code.
std::string parse_enrolment_code(std::string_view typed);

/// What a certificate of this authority says.
struct CertificateFacts {
  std::string appliance;    // "" where it names none
  std::string fingerprint;  // SHA-256 of its DER, hexadecimal
  UtcTime not_before, not_after;

  /// Whether less than a third of its time is left.
  [[nodiscard]] bool is_to_be_renewed(UtcTime now) const {
    return now >= not_after - (not_after - not_before) / 3;
  }
};
/// Throw kiroku::UsageError where there is none.
CertificateFacts facts_of_certificate(ByteView der);
CertificateFacts facts_of_certificate_pem(std::string_view pem);
/// Whether this authority issued it, for this key. Throws kiroku::UsageError for what is no certificate.
bool is_issued_for(std::string_view certificate_pem, std::string_view authority_pem,
                   std::string_view key_pem);

class FleetAuthority {
 public:
  /// authority.pem and authority.key (mode 0600) of the folder. Throws kiroku::UsageError where they are not
  /// there, do not belong together, or others may read the key; kiroku::IoError.
  static FleetAuthority open(const std::filesystem::path& folder);
  /// The same, made where the folder has neither.
  static FleetAuthority open_or_make(const std::filesystem::path& folder, UtcTime now);

  ~FleetAuthority();
  FleetAuthority(FleetAuthority&&) noexcept;
  FleetAuthority& operator=(FleetAuthority&&) noexcept;

  [[nodiscard]] const std::string& certificate_pem() const;
  /// A certificate for clients, for the request's key and name; appliance_of_request() was asked before.
  [[nodiscard]] std::string issue(std::string_view request_pem, UtcTime now, std::chrono::hours lasts) const;
  /// Under which an appliance asks what became of its request: 128 random bits and an HMAC of them under a
  /// key that follows from this authority's, in hexadecimal. So each server of the fleet knows by itself
  /// which ones a server of the fleet gave, and asks the database of no other. Throws kiroku::Error.
  [[nodiscard]] std::string new_enrolment_id() const;
  /// Of any text; takes as long for each wrong HMAC.
  [[nodiscard]] bool is_enrolment_id(std::string_view id) const;
  /// A certificate for servers with a new key, as long as the authority's.
  struct ServerIdentity {
    std::string certificate_pem;
    crypto::Secret key_pem;
  };
  [[nodiscard]] ServerIdentity issue_server_identity() const;

 private:
  struct State;
  explicit FleetAuthority(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::fleet

#include "fleet/reports/shared_stamp_client.h"

#include "base/printable.h"
#include "fleet/reports/stamp_messages.h"

namespace kiroku::fleet {
namespace {

constexpr long kRoundGoesOn = 202;
/// The authority gave none for the round; asking again changes nothing.
constexpr long kNoToken = 502;

}  // namespace

void SharedStampClient::connect() {
  const std::optional<ReportingIdentity> identity = ReportingIdentity::read(identity_file_);
  if (!identity)
    throw UsageError(
        "this appliance is not enrolled: run 'kiroku fleet enrol URL' (docs/how-to/run-a-fleet.md)");
  if (client_ && identity->url == url_ && identity->certificate_pem == certificate_) return;
  client_.emplace(*identity);
  url_ = identity->url;
  certificate_ = identity->certificate_pem;
}

evidence::SharedStamps::Place SharedStampClient::enter(ByteView digest, ByteView nonce) {
  connect();
  return parse_place(
      client_->post(std::string(kStampPath), to_json({authority_, to_bytes(digest), to_bytes(nonce)})));
}

std::optional<Bytes> SharedStampClient::fetch(const Place& place) {
  if (!client_) connect();
  std::string answer;
  try {
    answer = client_->get(stamp_path(authority_, place.ticket));
  } catch (const ReportError& error) {
    if (!error.passes() || error.status() == kNoToken) throw;
    throw evidence::SharedStampsAway(error.what());
  }
  if (client_->status() == kRoundGoesOn) return {};
  return parse_record_answer(answer);
}

std::string SharedStampClient::path() const { return "shared, by " + printable(url_); }

}  // namespace kiroku::fleet

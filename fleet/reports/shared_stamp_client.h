// How an appliance has its checkpoints stamped together with those of other rooms: by its hospital's
// aggregator, as the appliance that is enrolled there. Used by one thread at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "evidence/shared_stamps.h"
#include "fleet/reports/report_client.h"

namespace kiroku::fleet {

class SharedStampClient final : public evidence::SharedStamps {
 public:
  /// `identity_file` is what 'kiroku fleet enrol' wrote; it is read each time, as it is renewed meanwhile,
  /// and need not be there yet. `authority`: by which one, as the aggregator names it too.
  SharedStampClient(std::filesystem::path identity_file, std::string authority)
      : identity_file_(std::move(identity_file)), authority_(std::move(authority)) {}

  /// Throw kiroku::Error: not enrolled, a refusal, or what no aggregator answers. Of no answer, and of one
  /// that a server gives while it is busy or without its database, fetch() throws SharedStampsAway.
  Place enter(ByteView digest, ByteView nonce) override;
  std::optional<Bytes> fetch(const Place& place) override;
  [[nodiscard]] std::string path() const override;

 private:
  void connect();

  const std::filesystem::path identity_file_;
  const std::string authority_;
  std::string url_, certificate_;  // of what client_ uses
  std::optional<ReportClient> client_;
};

}  // namespace kiroku::fleet

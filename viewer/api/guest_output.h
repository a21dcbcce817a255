// What a guest's WebSockets add to those of everybody else. Thread-safe.
#pragma once

#include <memory>
#include <string>

#include "viewer/api/viewer_context.h"
#include "viewer/http/socket.h"
#include "viewer/people/invitations.h"

namespace kiroku::viewer {

/// A connection of a guest's while it lives: tells the invitation, and the appliance log of a guest who is
/// back.
class GuestPresence {
 public:
  /// Refusal 403 where `request` is a guest's and asks for another room than theirs, 500 where the log cannot
  /// be written. Of everybody else: null.
  static std::unique_ptr<GuestPresence> of(ViewerContext& context, const Request& request,
                                           const std::string& room);
  ~GuestPresence();
  GuestPresence(const GuestPresence&) = delete;
  GuestPresence& operator=(const GuestPresence&) = delete;

  /// Whether what is recorded now may be seen.
  [[nodiscard]] bool is_admitted() const;
  /// The case that they may see; "": none has begun yet.
  [[nodiscard]] std::string case_id() const { return invitation_->view().case_id; }

 private:
  GuestPresence(ViewerContext& context, std::shared_ptr<Invitation> invitation);
  ViewerContext& context_;
  const std::shared_ptr<Invitation> invitation_;
};

/// Lets through only while the guest may see what is recorded: what comes between is not taken, as of a
/// browser that is too slow.
class GuestOutput final : public SocketOutput {
 public:
  GuestOutput(std::shared_ptr<SocketOutput> inner, std::unique_ptr<GuestPresence> presence);
  bool send_text(std::string text) override;
  bool send_bytes(std::shared_ptr<const Bytes> bytes) override;
  [[nodiscard]] std::size_t waiting() const override;
  void when_taken(std::function<void()> action) override;
  void end(std::string sentence) override;

 private:
  const std::shared_ptr<SocketOutput> inner_;
  const std::unique_ptr<GuestPresence> presence_;
};

}  // namespace kiroku::viewer

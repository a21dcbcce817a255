#include "viewer/api/guest_output.h"

#include <utility>

namespace kiroku::viewer {

std::unique_ptr<GuestPresence> GuestPresence::of(ViewerContext& context, const Request& request,
                                                 const std::string& room) {
  const std::shared_ptr<Invitation>& invitation = request.session->invitation();
  if (!invitation) return nullptr;
  if (invitation->terms().room != room) throw Refusal(403, "this invitation is for another room");
  const bool is_back = invitation->arrive();
  // From here on the destructor sees to it that what arrived departs.
  std::unique_ptr<GuestPresence> presence(new GuestPresence(context, invitation));
  if (is_back) {
    context.enter_access(request, context.case_of(room),
                         "watches " + room + " again by invitation " + invitation->id());
  }
  return presence;
}

GuestPresence::GuestPresence(ViewerContext& context, std::shared_ptr<Invitation> invitation)
    : context_(context), invitation_(std::move(invitation)) {}

GuestPresence::~GuestPresence() { invitation_->depart(); }

bool GuestPresence::is_admitted() const {
  return invitation_->admits(context_.running_case(invitation_->terms().room));
}

GuestOutput::GuestOutput(std::shared_ptr<SocketOutput> inner, std::unique_ptr<GuestPresence> presence)
    : inner_(std::move(inner)), presence_(std::move(presence)) {}

bool GuestOutput::send_text(std::string text) {
  return presence_->is_admitted() && inner_->send_text(std::move(text));
}

bool GuestOutput::send_bytes(std::shared_ptr<const Bytes> bytes) {
  return presence_->is_admitted() && inner_->send_bytes(std::move(bytes));
}

std::size_t GuestOutput::waiting() const { return inner_->waiting(); }

void GuestOutput::when_taken(std::function<void()> action) { inner_->when_taken(std::move(action)); }

void GuestOutput::end(std::string sentence) { inner_->end(std::move(sentence)); }

}  // namespace kiroku::viewer

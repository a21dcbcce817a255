// Messages of patient administration and scheduling as a stranger on the network sends them: what is read of
// a procedure can be written into a subject file, and what another message completes stays the same
// patient's.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "recorder/procedure/procedure_book.h"

namespace {

using namespace kiroku;            // NOLINT(google-build-using-namespace)
using namespace kiroku::recorder;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ProcedureData known;
  ProcedureBook book;
  for (const std::string_view bytes : split_hl7_messages(text_of(std::as_bytes(std::span(data, size))))) {
    const Hl7Parse parsed = parse_hl7_message(bytes);
    if (!parsed.message) continue;
    // Whatever type it says it is: the reader must not depend on whom it trusts.
    const std::vector<ProcedureMessage> messages =
        read_procedure_messages(*parsed.message, std::chrono::minutes(120));
    require(!messages.empty() && messages.size() <= kMostPatients);
    for (const ProcedureMessage& message : messages) {
      using Kind = ProcedureMessage::Kind;
      require(message.kind == Kind::kNothing || !message.patient.empty() || !message.appointment.empty());
      require(message.replaces.empty() || (!message.patient.empty() && message.replaces != message.patient));
      const auto subject = nlohmann::json::parse(text_of(subject_json(message.data)));
      require(subject.is_object());
      const ProcedureData before = known;
      complete(known, message.data);
      require(before.patient_id.empty() || known.patient_id == before.patient_id);
      require(known.staff.size() >= before.staff.size() &&
              std::ranges::equal(before.staff, std::span(known.staff).first(before.staff.size())));
      require(nlohmann::json::parse(text_of(subject_json(known))).is_object());
    }
    book.take_all(messages, UtcTime{});
  }
  // Whatever was taken is known after a start.
  const Bytes kept = book.exported();
  const ProcedureBook again = ProcedureBook::imported(kept);
  require(again.not_kept() == 0 && again.exported() == kept);
  return 0;
}

// HL7 as a stranger on the network sends it: framing, messages, everything that is read from them, answers.
// Nothing may be written that could not be read back, and a message sent again is recorded once.
#include <cstdint>
#include <cstdlib>

#include "base/bytes.h"
#include "base/error.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/mllp_framing.h"

namespace {

using namespace kiroku;            // NOLINT(google-build-using-namespace)
using namespace kiroku::recorder;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

void check_lines(const std::vector<media::VitalLine>& lines) {
  for (const media::VitalLine& line : lines) {
    const std::string text = media::to_json_line(line);
    require(media::parse_vital_line_of_any_kind(text).line.has_value());
  }
}

void check_message(std::string_view bytes) {
  Hl7Vitals vitals(std::chrono::minutes(330));
  const UtcTime now{std::chrono::microseconds(1'767'268'800'000'000)};
  const auto taken = vitals.take(bytes, 1, now, "fuzz");
  check_lines(taken.lines);
  require(taken.answer == "AA" || taken.lines.size() == 2);
  if (!taken.acknowledgement.empty()) {
    const Hl7Parse answer = parse_hl7_message(taken.acknowledgement);
    require(answer.message != nullptr && answer.message->segments().size() == 2);
  }
  const auto again = vitals.take(bytes, 2, now, "fuzz");
  check_lines(again.lines);
  require(taken.answer != "AA" || again.lines.size() == 1);
}

/// With places named, nothing of another one is written.
void check_places(std::string_view bytes) {
  const UtcTime now{std::chrono::microseconds(1'767'268'800'000'000)};
  Hl7Vitals vitals(std::chrono::minutes(0), {}, PlaceList::parse("OR1", "fuzz"));
  const auto taken = vitals.take(bytes, 1, now, "fuzz");
  check_lines(taken.lines);
  for (const media::VitalLine& line : taken.lines) {
    const auto* const sample = std::get_if<media::VitalSample>(&line);
    require(sample == nullptr || sample->source.find('[') != std::string::npos);
  }
}

void check_framing(std::string_view bytes) {
  MllpDeframer deframer(1000);
  while (auto event = deframer.feed(bytes)) {
    require(event->kind != MllpDeframer::Event::Kind::kMessage || event->text.size() <= 1000);
  }
  require(bytes.empty() && deframer.partial().size() <= 1000);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = text_of(std::as_bytes(std::span(data, size)));
  check_framing(text);
  for (const std::string_view message : split_hl7_messages(text)) {
    check_message(message);
    check_places(message);
  }
  if (const auto time = parse_hl7_time(text))
    require(time->utc(std::chrono::minutes(0)).time_since_epoch().count() < INT64_MAX);
  return 0;
}

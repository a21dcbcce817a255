// What appliances and aggregators say to each other, either of which may be a stranger: it is read, and then
// written as it was, or refused with a sentence.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/bytes.h"
#include "base/error.h"
#include "fleet/reports/stamp_messages.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

template <typename Read>
void read_or_refuse(const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    require(!std::string_view(error.what()).empty());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = text_of(std::as_bytes(std::span(data, size)));
  read_or_refuse([&] {
    const fleet::StampRequest asked = fleet::parse_stamp_request(text);
    require(text.size() <= fleet::kLargestStampRequest && asked.digest.size() == asked.nonce.size());
    require(fleet::parse_stamp_request(fleet::to_json(asked)).digest == asked.digest);
  });
  read_or_refuse([&] {
    const evidence::SharedStamps::Place place = fleet::parse_place(text);
    require(fleet::is_stamp_ticket(place.ticket) && place.ready_in >= std::chrono::milliseconds(0));
    require(fleet::parse_place(fleet::place_json(place)).ready_in == place.ready_in);
  });
  read_or_refuse([&] {
    const Bytes record = fleet::parse_record_answer(text);
    require(record.size() <= fleet::kLargestSharedToken);
    require(fleet::parse_record_answer(fleet::record_json(record)) == record);
  });
  if (const auto question = fleet::parse_stamp_path(text))
    require(fleet::stamp_path(question->authority, question->ticket) == text);
  return 0;
}

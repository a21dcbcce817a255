// An evidence record in XML, which any archive wrote, and data that is XML: reading and judging end within
// the limits, and what is refused is refused in one sentence. The canonical form of a document is a document
// whose canonical form is itself.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "evidence/xml_canonical.h"
#include "evidence/xml_record.h"

namespace {

using namespace kiroku;            // NOLINT(google-build-using-namespace)
using namespace kiroku::evidence;  // NOLINT(google-build-using-namespace)

void check_form(std::string_view xml, Canonicalization how) {
  std::string form;
  try {
    form = canonical_document(parse_xml(xml), how);
  } catch (const Error& error) {
    if (std::string_view(error.what()).empty()) std::abort();
    return;
  }
  std::string again;
  try {
    again = canonical_document(parse_xml(form), how);
  } catch (const Error&) {
    return;  // the parser takes some characters and names that are none of XML's
  }
  try {
    if (canonical_document(parse_xml(again), how) != again) std::abort();
  } catch (const Error&) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view xml = text_of(std::as_bytes(std::span(data, size)));
  check_form(xml, {.exclusive = false, .with_comments = true});
  check_form(xml, {.exclusive = true, .with_comments = false});
  try {
    const XmlRecord record = XmlRecord::parse(xml);
    DataObject object{"data", [](crypto::HashAlgorithm algorithm) {
                        return std::optional(crypto::digest(algorithm, bytes_of(std::string_view("data"))));
                      }};
    object.content = bytes_of(xml);
    const RecordJudgement judgement = record.judge({object}, {.now = utc_now()});
    if (judgement.standing() == Standing::kHolds) std::abort();  // nobody is trusted
  } catch (const Error& error) {
    if (std::string_view(error.what()).empty()) std::abort();
  }
  return 0;
}

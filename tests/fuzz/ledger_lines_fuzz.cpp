// Lines of a case's ledger and of the appliance log, excerpt.json, and the text of a store statement, as a
// stranger may have written them.
// What is accepted is written again in the one form of the format, and that form reads back as itself.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "archive/format/boot_quote.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/log_entry.h"
#include "archive/format/store_statement.h"
#include "archive/format/strict_json.h"

namespace {

using namespace kiroku::archive;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

/// However it is read, a text says the same: a blank leads past the reader of what programs write.
void check_json(std::string_view text) {
  const JsonParse parse = parse_json(text), other = parse_json(" " + std::string(text));
  require(parse.value == other.value || text.size() == JsonLimits{}.bytes);
}

void check_case_entry(std::string_view line) {
  const EntryParse parse = parse_case_entry(line);
  require(parse.entry.has_value() == parse.problem.empty());
  if (parse.entry) {
    const std::string written = to_line(*parse.entry);
    const EntryParse again = parse_case_entry(written);
    require(again.entry && to_line(*again.entry) == written);
  }
}

void check_log_entry(std::string_view line) {
  const LogEntryParse parse = parse_log_entry(line);
  if (parse.entry) {
    const std::string written = to_line(*parse.entry);
    const LogEntryParse again = parse_log_entry(written);
    require(again.entry && to_line(*again.entry) == written);
    const auto* boot = std::get_if<BootEntry>(&parse.entry->body);
    if (boot != nullptr && boot->quote) {
      const auto quote = from_stated(*boot->quote);
      require(!quote || to_stated(*quote).pcrs == boot->quote->pcrs);
    }
  }
}

void check_excerpt(std::string_view text) {
  const ExcerptParse parse = parse_excerpt(text);
  require(parse.document.has_value() == parse.problem.empty());
  if (parse.document) {
    const std::string written = to_text(*parse.document);
    const ExcerptParse again = parse_excerpt(written);
    require(again.document && to_text(*again.document) == written);
  }
}

void check_statement(std::string_view text) {
  const auto statement = parse_store_statement(text);
  require(!statement || statement->to_text() == text);  // it has one form
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  check_json(text);
  check_case_entry(text);
  check_log_entry(text);
  check_excerpt(text);
  check_statement(text);
  return 0;
}

// Character sets of HL7 v2 messages (MSH-18, HL7 table 0211, and what monitors write there). Functions;
// thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::recorder {

struct Utf8Text {
  std::string text;
  std::string remark;  // a sentence where the stated character set was not the one that fits; "" else
};

/// `bytes` as UTF-8. `stated` are the repetitions of MSH-18 ("8859/1", "UNICODE UTF-8", "ISO IR87", "CP932",
/// …; none: ASCII). Bytes that do not fit what is stated are read as UTF-8 if they are that, else as ISO
/// 8859-1, in which every byte is a character, so that nothing is lost; the remark says so.
Utf8Text hl7_text_as_utf8(std::string_view bytes, const std::vector<std::string>& stated);

/// Loads the tables of all known sets, so that they are there where no file can be opened any more.
void keep_charsets_at_hand();

/// `bytes` as UTF-8 from the iconv character set `charset`; nothing where they do not fit it, or iconv does
/// not know it.
std::optional<std::string> converted_to_utf8(std::string_view bytes, const std::string& charset);

}  // namespace kiroku::recorder

// Where things lie in a case folder and what they are called: the one place for the names of format 1
// (docs/reference/format.md, "Layout"). Pure functions, thread-safe.
//
//   ledger.jsonl                               kLedgerFile
//   checkpoints/00000042.note                  note_path(42): tree size, at least eight digits
//   tokens/00000042.<authority>.tsr            token_path(42, "swiss", TokenForm::kResponse)
//   tokens/00000042.<authority>.ers            token_path(42, "swiss", TokenForm::kShared)
//   segments/endoscope/00000000.ts.age         segment_path("endoscope", 0, "ts"), at least eight digits
//   subject.json.age                           kSubjectFile
//   device.pub                                 kDeviceFile
//   authorities/<authority>.pem                kAuthoritiesFolder
//
// Sizes and indexes have no upper bound; above 99,999,999 the number simply takes more digits. A name with
// more leading zeros than that is not one of the format.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace kiroku::archive {

inline constexpr std::string_view kLedgerFile = "ledger.jsonl";
inline constexpr std::string_view kCheckpointsFolder = "checkpoints";
inline constexpr std::string_view kTokensFolder = "tokens";
inline constexpr std::string_view kSegmentsFolder = "segments";
inline constexpr std::string_view kAuthoritiesFolder = "authorities";
inline constexpr std::string_view kSubjectFile = "subject.json.age";
inline constexpr std::string_view kDeviceFile = "device.pub";
/// Evidence records, in the archive beside the cases: evidence/<case>.ers.
inline constexpr std::string_view kEvidenceFolder = "evidence";
/// Lines that stood in the appliance log and were not its device's, in the archive beside the cases.
inline constexpr std::string_view kLogAsideFolder = "log-aside";
/// What a file is called until it is wholly there.
inline constexpr std::string_view kPartSuffix = ".part";

/// "00000042", or more digits where eight do not do.
std::string format_index(std::uint64_t number);
/// The number of a name made by format_index(); nothing for any other text.
std::optional<std::uint64_t> parse_index(std::string_view text);

std::string note_path(std::uint64_t size);
/// What a token's file is: an RFC 3161 response of its own, or a token that others share and the path to it
/// (evidence/shared_token.h). Of one authority over one checkpoint there is one file, of either form.
enum class TokenForm { kResponse, kShared };
std::string token_path(std::uint64_t size, std::string_view authority, TokenForm form = TokenForm::kResponse);
/// A complete segment. An incomplete one (`"complete": false`) is the same with kPartSuffix.
std::string segment_path(std::string_view stream, std::uint64_t index, std::string_view extension);

/// Tree size of "00000042.note" (a bare file name); nothing for any other name.
std::optional<std::uint64_t> size_of_note_name(std::string_view name);
/// What "00000042.swiss.tsr" and "00000042.swiss.ers" say; nothing for any other name.
struct TokenName {
  std::uint64_t size = 0;
  std::string authority;
  TokenForm form = TokenForm::kResponse;
};
std::optional<TokenName> parse_token_name(std::string_view name);

/// Media type of streams of lines: vital signs, marks.
inline constexpr std::string_view kLinesMedia = "application/jsonl";
inline constexpr std::string_view kLinesProfile = "jsonl";
/// Extension of a stream's plaintext: "video/mp2t" ts, "video/x-matroska" mkv, "application/jsonl" jsonl;
/// nothing for a media type that format 1 does not have.
std::optional<std::string_view> extension_of_media(std::string_view media);

/// [a-z0-9][a-z0-9-]{0,31}, what stream and authority names must be: safe as file names everywhere.
bool is_short_name(std::string_view text);
/// "20260805T091502Z-3f9c21ab".
bool is_case_id(std::string_view text);

/// Origin line of a case's checkpoints: "kiroku/<device name>/<case id>".
std::string case_origin(std::string_view device_name, std::string_view case_id);
/// Origin line of the appliance log's checkpoints: "kiroku/<device name>/log". No case can have it, since
/// "log" is no case identifier.
std::string log_origin(std::string_view device_name);

}  // namespace kiroku::archive

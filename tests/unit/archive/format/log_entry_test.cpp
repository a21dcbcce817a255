#include "archive/format/log_entry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "crypto/hash.h"

namespace kiroku::archive {
namespace {

using testing::HasSubstr;

constexpr std::string_view kCase = "20260805T091502Z-3f9c21ab";
crypto::Sha256Digest some_digest() { return crypto::sha256(bytes_of("abc")); }
constexpr std::string_view kHex = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

LogEntry entry_of(LogEntryBody body) {
  return {7, {*parse_utc("2026-08-05T09:15:02.000123Z"), 42}, std::move(body)};
}

std::string head_of(std::string_view type) {
  return "{\"type\":\"" + std::string(type) +
         "\",\"seq\":7,\"utc\":\"2026-08-05T09:15:02.000123Z\",\"mono_ns\":42";
}

struct Example {
  LogEntryBody body;
  std::string line;
};

std::vector<Example> examples() {
  const std::string id(kCase);
  const std::string hex(kHex);
  const std::string with_case = ",\"case\":\"" + id + "\"";
  const StatedQuote quote{"cQ==", "cw==", {"4:" + hex, "14:" + hex}};
  const std::string with_quote =
      R"(,"quote":"cQ==","quote_signature":"cw==","pcrs":["4:)" + hex + R"(","14:)" + hex + R"("]})";
  return {
      {BootEntry{"b1", "dev+1+k"}, head_of("boot") + R"(,"boot_id":"b1","device":"dev+1+k"})"},
      {BootEntry{"b1", "dev+1+k", quote, {}},
       head_of("boot") + R"(,"boot_id":"b1","device":"dev+1+k")" + with_quote},
      {BootEntry{"b1", "dev+1+k", {}, "no TPM"},
       head_of("boot") + R"(,"boot_id":"b1","device":"dev+1+k","no_quote":"no TPM"})"},
      {DeviceAttestationEntry{"YQ==", quote},
       head_of("device-attestation-added") + R"(,"attestation":"YQ==")" + with_quote},
      {ShutdownEntry{}, head_of("shutdown") + "}"},
      {ConfigChangedEntry{some_digest()}, head_of("config-changed") + ",\"sha256\":\"" + hex + "\"}"},
      {DeviceKeyChangedEntry{"dev+2+k"}, head_of("device-key-changed") + R"(,"device":"dev+2+k"})"},
      {DeviceMlDsaEntry{"dev/ml-dsa-65+2+k"},
       head_of("device-ml-dsa-added") + R"(,"ml_dsa":"dev/ml-dsa-65+2+k"})"},
      {DeviceHardwareEntry{"dev/ecdsa-p256+2+k"},
       head_of("device-hardware-added") + R"(,"hardware":"dev/ecdsa-p256+2+k"})"},
      {DeviceHardwareSilentEntry{"no TPM"}, head_of("device-hardware-silent") + R"(,"why":"no TPM"})"},
      {PlanSealedEntry{some_digest()}, head_of("plan-sealed") + ",\"sha256\":\"" + hex + "\"}"},
      {CaseOpenedEntry{id, some_digest()},
       head_of("case-opened") + with_case + ",\"sha256\":\"" + hex + "\"}"},
      {CaseCheckpointEntry{id, 9, some_digest()},
       head_of("case-checkpoint") + with_case + ",\"size\":9,\"root\":\"" + hex + "\"}"},
      {CaseClosedEntry{id, 9, some_digest(), some_digest()}, head_of("case-closed") + with_case +
                                                                 ",\"size\":9,\"root\":\"" + hex +
                                                                 "\",\"final_token\":\"" + hex + "\"}"},
      {CaseClosedEntry{id, 9, some_digest(), {}},
       head_of("case-closed") + with_case + ",\"size\":9,\"root\":\"" + hex + "\"}"},
      {ReplicatedEntry{id, "s3://x"}, head_of("replicated") + with_case + R"(,"target":"s3://x"})"},
      {CaseErasedEntry{id, {}, "10 years"}, head_of("erased") + with_case + R"(,"policy":"10 years"})"},
      {CaseErasedEntry{id, "room", "30 days"},
       head_of("erased") + with_case + R"(,"stream":"room","policy":"30 days"})"},
      {AccessEntry{"a/folder", "export room", "Dr. Sato"},
       head_of("access") + R"(,"case":"a/folder","what":"export room","who":"Dr. Sato"})"},
      {LogRecoveredEntry{17}, head_of("recovered") + R"(,"truncated":17})"},
      {LogDamageEntry{7, some_digest(), some_digest()},
       head_of("damage-found") + ",\"size\":7,\"stated_root\":\"" + hex + "\",\"root\":\"" + hex + "\"}"},
      {LogDamageEntry{7, some_digest(), {}},
       head_of("damage-found") + ",\"size\":7,\"stated_root\":\"" + hex + "\"}"},
      {PreRollDiscardedEntry{3, 4'000'000'000},
       head_of("pre-roll-discarded") + R"(,"segments":3,"duration_ns":4000000000})"},
      {PreRollDiscardedEntry{3, {}}, head_of("pre-roll-discarded") + R"(,"segments":3})"},
      {CaseHeldEntry{id, "court order", "anna"},
       head_of("case-held") + with_case + R"(,"reason":"court order","who":"anna"})"},
      {CaseReleasedEntry{id, 12, "settled", "ben"},
       head_of("case-released") + with_case + R"(,"hold":12,"reason":"settled","who":"ben"})"},
      {AccessEntry{id, "exported room", "anna", "teaching"},
       head_of("access") + with_case + R"(,"what":"exported room","who":"anna","purpose":"teaching"})"},
      {ConsentGivenEntry{{id, {"teaching", "research"}, some_digest(), some_digest(), "anna"}},
       head_of("consent-given") + with_case + R"(,"purposes":["teaching","research"],"statement":")" + hex +
           R"(","form":")" + hex + R"(","who":"anna"})"},
      {ConsentWithdrawnEntry{{id, {"teaching"}, some_digest(), {}, "ben"}},
       head_of("consent-withdrawn") + with_case + R"(,"purposes":["teaching"],"statement":")" + hex +
           R"(","who":"ben"})"},
  };
}

TEST(LogEntry, IsWrittenAsTheFormatSays) {
  for (const Example& example : examples()) {
    EXPECT_EQ(to_line(entry_of(example.body)), example.line);
  }
}

TEST(LogEntry, IsReadBackToTheSameLine) {
  for (const Example& example : examples()) {
    const LogEntryParse parsed = parse_log_entry(example.line);
    ASSERT_TRUE(parsed.entry) << parsed.problem;
    EXPECT_EQ(parsed.entry->body.index(), example.body.index());
    EXPECT_EQ(parsed.entry->seq, 7U);
    EXPECT_EQ(parsed.entry->at.mono_ns, 42);
    EXPECT_EQ(to_line(*parsed.entry), example.line);
  }
}

// A purpose stands in the clear: it can name nobody in free words, and looks like no other.
TEST(LogEntry, RefusesPurposesThatAreNoShortNames) {
  const std::string before = head_of("consent-given") + R"(,"case":"20260805T091502Z-3f9c21ab","purposes":)";
  const std::string after = R"(,"statement":")" + crypto::to_hex(some_digest()) + R"(","who":"anna"})";
  ASSERT_TRUE(parse_log_entry(before + R"(["teaching"])" + after).entry);
  std::string many = "[";
  for (int i = 0; i < 33; ++i) many += (i == 0 ? "\"a" : ",\"a") + std::to_string(i) + "\"";
  const std::vector<std::string> bad{"[]",
                                     R"([""])",
                                     R"(["teaching","teaching"])",
                                     R"(["Teaching"])",
                                     R"(["teaching\u0007"])",
                                     R"(["teaching\u202e"])",
                                     R"(["t\u0435aching"])",
                                     R"(["teaching of Hana Mori"])",
                                     R"("teaching")",
                                     R"([["teaching"]])",
                                     "[\"" + std::string(33, 'a') + "\"]",
                                     many + "]"};
  for (const std::string& each : bad) EXPECT_FALSE(parse_log_entry(before + each + after).entry) << each;
}

TEST(LogEntry, RefusesRegistersThatAreNone) {
  const std::string before =
      head_of("boot") + R"(,"boot_id":"b","device":"d","quote":"","quote_signature":"","pcrs":)";
  const std::string hex(kHex);
  ASSERT_TRUE(parse_log_entry(before + "[\"23:" + hex + "\"]}").entry);
  std::string many = "[";
  for (int i = 0; i < 25; ++i) many += (i == 0 ? "\"1:" : ",\"1:") + hex + "\"";
  const std::vector<std::string> bad{"[]",
                                     "[\"24:" + hex + "\"]",
                                     "[\"04:" + hex + "\"]",
                                     "[\"-4:" + hex + "\"]",
                                     "[\":" + hex + "\"]",
                                     "[\"" + hex + "\"]",
                                     "[\"4:" + hex + "0\"]",
                                     "[\"4:" + hex.substr(1) + "\"]",
                                     "[\"4:" + hex.substr(1) + "F\"]",
                                     "[\"4 :" + hex + "\"]",
                                     "[4]",
                                     "{}",
                                     many + "]"};
  for (const std::string& each : bad) EXPECT_FALSE(parse_log_entry(before + each + "}").entry) << each;
  EXPECT_FALSE(parse_log_entry(before + "[\"4:" + hex + "\"],\"no_quote\":\"why\"}").entry) << "both";
}

TEST(LogEntry, RefusesALineFromWhichAnyMemberIsMissing) {
  for (const Example& example : examples()) {
    // Cut each member out in turn; `final_token`, an erased stream, a lost duration and the root of
    // what is not there may be absent.
    std::size_t start = 1;
    while (start < example.line.size() - 1) {
      const bool last = example.line.find(",\"", start) == std::string::npos;
      const std::size_t end = last ? example.line.size() - 1 : example.line.find(",\"", start);
      std::string cut = example.line;
      if (last) {
        cut.erase(start - 1, end - start + 1);
      } else {
        cut.erase(start, end - start + 1);
      }
      if (example.line.compare(start, 13, "\"final_token\"") != 0 &&
          example.line.compare(start, 8, "\"stream\"") != 0 &&
          example.line.compare(start, 13, "\"duration_ns\"") != 0 &&
          example.line.compare(start, 9, "\"purpose\"") != 0 &&
          example.line.compare(start, 10, "\"no_quote\"") != 0 &&
          example.line.compare(start, 6, "\"form\"") != 0 &&
          !(example.line.find("damage-found") < start && example.line.compare(start, 6, "\"root\"") == 0)) {
        EXPECT_FALSE(parse_log_entry(cut).entry) << cut;
      }
      start = end + 1;
    }
  }
}

TEST(LogEntry, RefusesUnknownMembersAndTypes) {
  EXPECT_THAT(parse_log_entry(head_of("shutdown") + R"(,"more":1})").problem, HasSubstr("more"));
  EXPECT_THAT(parse_log_entry(head_of("restart") + "}").problem, HasSubstr("type"));
  EXPECT_THAT(parse_log_entry(head_of("open") + "}").problem, HasSubstr("type"));
}

TEST(LogEntry, RefusesACaseThatIsNoIdentifier) {
  EXPECT_THAT(parse_log_entry(head_of("erased") + R"(,"case":"../x","policy":"p"})").problem,
              HasSubstr("case"));
}

TEST(LogEntry, RefusesNestedValues) {
  EXPECT_FALSE(parse_log_entry(head_of("replicated") + R"(,"case":{"a":1},"target":"t"})").entry);
  EXPECT_FALSE(parse_log_entry("[]").entry);
  EXPECT_FALSE(parse_log_entry("").entry);
}

}  // namespace
}  // namespace kiroku::archive

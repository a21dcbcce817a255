#include "archive/format/store_statement.h"

#include <gtest/gtest.h>

#include "crypto/hash.h"

namespace kiroku::archive {
namespace {

StoreStatement sample() {
  StoreStatement statement;
  statement.maker = "or-2";
  statement.case_id = "20260805T091502Z-3f9c21ab";
  statement.device = "or-1+1a2b3c4d+AbC";
  statement.store = "https://store.hospital.example/recordings/or-1";
  statement.looked = *parse_utc("2026-08-05T17:00:00Z");
  statement.newest = *parse_utc("2026-08-05T11:40:17Z");
  statement.log = {57, crypto::sha256(bytes_of("log"))};
  statement.entries = {42, crypto::sha256(bytes_of("entries"))};
  statement.signed_entries = {40, crypto::sha256(bytes_of("signed"))};
  statement.files = {{"checkpoints/00000040.note", crypto::sha256(bytes_of("note"))},
                     {"tokens/00000040.swiss.tsr", crypto::sha256(bytes_of("token"))}};
  statement.missing = {"segments/room/00000003.ts.age"};
  return statement;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  if (at == std::string::npos) throw std::logic_error("not there: " + what);
  return text.replace(at, what.size(), by);
}

TEST(StoreStatement, ReadsWhatItWrites) {
  const std::optional<StoreStatement> read = parse_store_statement(sample().to_text());
  ASSERT_TRUE(read);
  EXPECT_EQ(read->to_text(), sample().to_text());
  EXPECT_TRUE(read->says_the_same(sample()));
  EXPECT_EQ(read->newest, sample().newest);
  StoreStatement without = sample();
  without.newest.reset();
  without.files.clear();
  without.missing.clear();
  const std::optional<StoreStatement> short_one = parse_store_statement(without.to_text());
  ASSERT_TRUE(short_one);
  EXPECT_FALSE(short_one->newest);
  EXPECT_FALSE(short_one->says_the_same(sample()));
}

TEST(StoreStatement, SaysTheSameWhoeverSaysItAndWhen) {
  StoreStatement later = sample();
  later.maker = "or-3";
  later.looked += std::chrono::hours(1);
  later.log.size = 99;
  EXPECT_TRUE(later.says_the_same(sample()));
  later.entries.root = crypto::sha256(bytes_of("others"));
  EXPECT_FALSE(later.says_the_same(sample()));
}

TEST(StoreStatement, TakesNoOtherText) {
  const std::string text = sample().to_text();
  ASSERT_TRUE(parse_store_statement(text));
  for (const auto& [what, by] : std::vector<std::pair<std::string, std::string>>{
           {"kiroku/or-2/store-statement", "kiroku/or-2/log"},
           {"kiroku/or-2/store-statement", "kiroku//store-statement"},
           {"case 20260805T091502Z-3f9c21ab", "case log"},
           {"case ", "of "},
           {"store https://store.hospital.example/recordings/or-1", "store "},
           {"17:00:00.000000Z", "17:00:00Z"},
           {"newest 2026-08-05T11:40:17.000000Z", "newest yesterday"},
           {"entries 42 ", "entries 042 "},
           {"entries 42 ", "entries 0 "},
           {"entries 42 ", "entries 39 "},
           {"entries 42 ", "entries -1 "},
           {"log 57 ", "log 57"},
           {"file ", "file  "},
           {"  checkpoints/", " checkpoints/"},
           {"checkpoints/00000040.note", "../00000040.note"},
           {"checkpoints/00000040.note", "z/00000040.note"},
           {"checkpoints/00000040.note", "-c/00000040.note"},
           {"checkpoints/00000040.note", "checkpoints//00000040.note"},
           {"missing segments/room", "missing segments room"},
           {"missing ", "lost "}}) {
    EXPECT_FALSE(parse_store_statement(replaced(text, what, by))) << what << " -> " << by;
  }
  EXPECT_FALSE(parse_store_statement(text + "more\n"));
  EXPECT_FALSE(parse_store_statement(text + "missing segments/room/00000003.ts.age\n")) << "it stands twice";
  EXPECT_FALSE(parse_store_statement(text + "file " + std::string(64, 'a') + "  tokens/z\n")) << "behind";
  EXPECT_FALSE(parse_store_statement(text.substr(0, text.size() - 1)));
  EXPECT_FALSE(parse_store_statement(""));
}

TEST(StoreStatement, IsKnownByItsName) {
  const std::string name = store_statement_name(*parse_utc("2026-08-05T17:00:00Z"), 0x5e6f7a0b);
  EXPECT_EQ(name, "20260805T170000Z-5e6f7a0b.note");
  EXPECT_TRUE(is_store_statement_name(name));
  EXPECT_FALSE(is_store_statement_name("20260805T170000Z-5e6f7a0b.note.part"));
  EXPECT_FALSE(is_store_statement_name("00000042.note"));
  EXPECT_TRUE(is_store_statement_token_name("20260805T170000Z-5e6f7a0b.swiss.tsr"));
  EXPECT_FALSE(is_store_statement_token_name("20260805T170000Z-5e6f7a0b.tsr"));
  EXPECT_FALSE(is_store_statement_token_name("20260805T170000Z-5e6f7a0b..tsr"));
  EXPECT_FALSE(is_store_statement_token_name("20260805T170000Z-5e6f7a0b.a.b.tsr"));
  EXPECT_EQ(store_statements_folder("/archive/20260805T091502Z-3f9c21ab/", "20260805T091502Z-3f9c21ab"),
            "/archive/store-statements/20260805T091502Z-3f9c21ab");
}

TEST(StoreStatement, SpeaksOfWhatIsProvenWith) {
  EXPECT_TRUE(is_of_store_statement("subject.json.age"));
  EXPECT_TRUE(is_of_store_statement("checkpoints/00000040.note"));
  EXPECT_TRUE(is_of_store_statement("segments/room/00000003.ts.age.part"));
  EXPECT_FALSE(is_of_store_statement("ledger.jsonl"));
  EXPECT_FALSE(is_of_store_statement("device.pub"));
  EXPECT_FALSE(is_of_store_statement("authorities/swiss.pem"));
  EXPECT_FALSE(is_of_store_statement("checkpoints/.DS_Store"));
}

}  // namespace
}  // namespace kiroku::archive

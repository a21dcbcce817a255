// What every table of cases must do, whichever database holds it. A program gives it a fixture with `open()`,
// which returns the same empty table again and again: INSTANTIATE_TYPED_TEST_SUITE_P(Sqlite, CaseTableSuite,
// Fixture).
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/catalogue/case_table.h"

namespace kiroku::archive {

template <typename Fixture>
class CaseTableSuite : public Fixture {
 protected:
  static CatalogueRow row(const std::string& case_id, const char* opened) {
    CatalogueRow row;
    row.case_id = case_id;
    row.opened = *parse_utc(opened);
    row.duration_ns = 7'000'000'000;
    row.state = "closed";
    row.streams = {"endoscope", "room"};
    row.segments = 4;
    row.bytes = 5'000'000'000'000;
    row.tokens = 2;
    return row;
  }
  static std::vector<std::string> ids(const std::vector<CatalogueRow>& rows) {
    std::vector<std::string> ids;
    for (const CatalogueRow& each : rows) ids.push_back(each.case_id);
    return ids;
  }
};
TYPED_TEST_SUITE_P(CaseTableSuite);

TYPED_TEST_P(CaseTableSuite, GivesBackWhatWasPut) {
  const auto table = this->open();
  CatalogueRow put = this->row("20260805T091502Z-3f9c21ab", "2026-08-05T09:15:02.000123Z");
  table->put(put, {1234, 9'000'000'000'000'000'000});
  CatalogueRow open = this->row("20261231T235959Z-00000000", "2026-12-31T23:59:59.999999Z");
  open.duration_ns.reset();
  open.state = "open";
  open.streams.clear();
  table->put(open, {});
  const auto rows = this->open()->rows();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].case_id, open.case_id);
  EXPECT_EQ(rows[0].opened, open.opened);
  EXPECT_EQ(rows[0].duration_ns, std::nullopt);
  EXPECT_THAT(rows[0].streams, testing::IsEmpty());
  EXPECT_EQ(rows[1].opened, put.opened);
  EXPECT_EQ(rows[1].duration_ns, put.duration_ns);
  EXPECT_EQ(rows[1].state, "closed");
  EXPECT_EQ(rows[1].streams, put.streams);
  EXPECT_EQ(rows[1].segments, put.segments);
  EXPECT_EQ(rows[1].bytes, put.bytes);
  EXPECT_EQ(rows[1].tokens, put.tokens);
  EXPECT_EQ(rows[1].last_verdict, std::nullopt);
  EXPECT_EQ(rows[1].verified, std::nullopt);
  EXPECT_EQ(table->stamps(), (std::map<std::string, CaseStamp>{
                                 {put.case_id, {1234, 9'000'000'000'000'000'000}}, {open.case_id, {}}}));
}

TYPED_TEST_P(CaseTableSuite, HasTheNewestFirst) {
  const auto table = this->open();
  for (const char* id : {"b", "c", "a", "B"}) table->put(this->row(id, "2026-08-05T09:15:02Z"), {});
  table->put(this->row("older", "2026-08-05T09:15:01.999999Z"), {});
  table->put(this->row("newer", "2026-08-05T09:15:02.000001Z"), {});
  EXPECT_THAT(this->ids(table->rows()), testing::ElementsAre("newer", "c", "b", "a", "B", "older"));
  table->remove("b");
  table->remove("nobody");
  EXPECT_THAT(this->ids(table->rows()), testing::ElementsAre("newer", "c", "a", "B", "older"));
}

TYPED_TEST_P(CaseTableSuite, KeepsAVerdictWhileTheStampIsTheSame) {
  const auto table = this->open();
  CatalogueRow row = this->row("a", "2026-08-05T09:15:02Z");
  const UtcTime when = *parse_utc("2026-08-06T00:00:00.5Z");
  for (const CaseStamp other : {CaseStamp{2, 7}, CaseStamp{1, 8}}) {
    table->put(row, {1, 7});
    table->set_verdict("a", "intact", when);
    table->set_verdict("nobody", "intact", when);
    row.last_verdict = "tampered";  // of no meaning
    table->put(row, {1, 7});
    ASSERT_EQ(table->rows().size(), 1U);
    EXPECT_EQ(table->rows()[0].last_verdict, "intact");
    EXPECT_EQ(table->rows()[0].verified, when);
    table->put(row, other);
    EXPECT_EQ(table->rows()[0].last_verdict, std::nullopt);
    EXPECT_EQ(table->rows()[0].verified, std::nullopt);
  }
}

TYPED_TEST_P(CaseTableSuite, DoesAllOfItsWorkOrNone) {
  const auto table = this->open();
  table->together([&] { table->put(this->row("a", "2026-08-05T09:15:02Z"), {}); });
  EXPECT_THROW(table->together([&] {
    table->remove("a");
    table->put(this->row("b", "2026-08-05T09:15:02Z"), {});
    throw std::runtime_error("stopped");
  }),
               std::runtime_error);
  EXPECT_THAT(this->ids(table->rows()), testing::ElementsAre("a"));
  table->put(this->row("c", "2026-08-05T09:15:02Z"), {});
  EXPECT_EQ(this->open()->rows().size(), 2U);
}

TYPED_TEST_P(CaseTableSuite, TakesTextOfAnyKind) {
  const auto table = this->open();
  CatalogueRow row = this->row("it's \"odd\"; DROP TABLE cases; -- 記録", "1970-01-01T00:00:00Z");
  table->put(row, {});
  table->set_verdict(row.case_id, "in$1tact'", *parse_utc("2026-08-06T00:00:00Z"));
  ASSERT_EQ(table->rows().size(), 1U);
  EXPECT_EQ(table->rows()[0].case_id, row.case_id);
  EXPECT_EQ(table->rows()[0].last_verdict, "in$1tact'");
}

REGISTER_TYPED_TEST_SUITE_P(CaseTableSuite, GivesBackWhatWasPut, HasTheNewestFirst,
                            KeepsAVerdictWhileTheStampIsTheSame, DoesAllOfItsWorkOrNone, TakesTextOfAnyKind);

}  // namespace kiroku::archive

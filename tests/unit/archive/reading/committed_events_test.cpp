#include "archive/reading/committed_events.h"

#include <string>

#include <gtest/gtest.h>

#include "archive/format/event_line.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

std::string line_of(const std::string& event) {
  return R"({"salt":")" + std::string(64, 'a') + R"(","event":")" + event + R"("})";
}

TEST(CommittedEvents, AreThoseOfTheLedgerEachOnce) {
  test::SampleArchive archive;
  test::SampleCase sample(archive);
  sample.record();
  for (int twice = 0; twice < 2; ++twice)
    sample.writer().append({MarkEntry{parse_event_line(line_of("Lift"))->commitment}}, archive.now());
  sample.close();
  CommittedEvents events(CaseReader::open(sample.folder()));
  EXPECT_EQ(events.lacking(), 3U) << "one more is of the sample";
  EXPECT_FALSE(events.take(line_of("Cut"))) << "no entry commits to it";
  EXPECT_FALSE(events.take("Lift")) << "no event";
  EXPECT_EQ(events.take(line_of("Lift")), "Lift");
  EXPECT_EQ(events.take(line_of("Lift")), "Lift");
  EXPECT_FALSE(events.take(line_of("Lift"))) << "more often than it was entered";
  EXPECT_EQ(events.lacking(), 1U);
}

}  // namespace
}  // namespace kiroku::archive

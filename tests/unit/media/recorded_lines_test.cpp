#include "media/recorded_lines.h"

#include "base/error.h"
#include "tests/support/forger.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

TEST(RecordedLines, AreThoseOfTheSegmentsThatAreThere) {
  const test::TemporaryFolder folder;
  const test::Reader reader = test::make_reader();
  test::RecordedStream events{"events", "events", "application/jsonl", {}, {2, 1, 1}};
  for (const char* text : {"one\ntwo\n", "three\n", "four\n"}) events.segments.push_back(to_bytes(text));
  const auto lines_of = [&](std::int64_t from_ns, std::int64_t to_ns) {
    const auto recording =
        archive::CaseReader::open(test::record_case(folder / "archive", {events}, reader.recipients));
    std::vector<std::string> lines;
    for_each_recorded_line(recording, reader.identities, "events", from_ns, to_ns,
                           [&](std::string_view line) { lines.emplace_back(line); });
    return lines;
  };
  EXPECT_EQ(lines_of(INT64_MIN, INT64_MAX), (std::vector<std::string>{"one", "two", "three", "four"}));
  EXPECT_EQ(lines_of(1'000'000'000, 1'500'000'000), std::vector<std::string>{"three"});
  events.first_is_erased = true;
  EXPECT_EQ(lines_of(INT64_MIN, INT64_MAX), (std::vector<std::string>{"three", "four"}));
}

TEST(RecordedLines, AreThoseThatWereHashedAlsoWhereTheFileIsExchangedMeanwhile) {
  const test::TemporaryFolder folder;
  const test::Reader reader = test::make_reader();
  const auto place = test::record_case(folder / "archive",
                                       {{"events", "events", "application/jsonl", {to_bytes("one\n")}, {1}}},
                                       reader.recipients);
  const auto recording = archive::CaseReader::open(place);
  const auto file = place / recording.segments("events", 0, INT64_MAX).at(0).file.file;
  const std::string forged = test::resealed(test::bytes_in(file), reader.identities, bytes_of("two\n"));
  const auto forging = test::observed(reader.identities, [&] { test::write_into(file, forged); });
  std::vector<std::string> lines;
  for_each_recorded_line(recording, forging, "events", INT64_MIN, INT64_MAX,
                         [&](std::string_view line) { lines.emplace_back(line); });
  EXPECT_EQ(lines, std::vector<std::string>{"one"});
}

}  // namespace
}  // namespace kiroku::media

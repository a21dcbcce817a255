// A disk that is really full: what the fault file system plays elsewhere happens here by itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer.h"
#include "archive/writing/log_reading.h"
#include "tests/support/case_kit.h"
#include "tests/support/small_disk.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::lies_of;
using test::moment;
using testing::IsEmpty;

TEST(FullDisk, IsStatedAsAGapAndTheCaseIsClosedAndStamped) {
  const test::SmallDisk disk(24U << 20U);
  if (!disk.mounted()) {
    GTEST_SKIP() << "no permission to mount a small file system";
  }
  const test::CaseKit kit(disk.path());
  const auto log = ApplianceLog::open(real_file_system(), disk.path() / "log", kit.key(), "theatre-1");
  auto options = kit.options();
  options.log = log.get();
  const auto writer = CaseWriter::create(real_file_system(), options, moment(0));
  const auto segment = writer->begin_segment(0, 0);
  const std::string film(1U << 20U, 'f');
  bool full = false;
  for (int megabyte = 0; megabyte < 30 && !full; ++megabyte) {
    try {
      segment->write(bytes_of(film));
    } catch (const IoError& error) {
      ASSERT_TRUE(error.disk_full()) << error.what();
      full = true;
    }
  }
  ASSERT_TRUE(full);
  disk.fill("filler");

  SegmentEntry entry;
  entry.file = segment->salvage().value();
  EXPECT_GT(entry.file.bytes, 12U << 20U) << "what was written before is kept";
  entry.stream = "room";
  entry.span = {0, 1'000'000'000};
  entry.time_base = "1/90000";
  entry.complete = false;
  // More than the ledger has blocks for, so that the reserve is needed for it as well.
  std::vector<CaseEntryBody> bodies{entry,
                                    GapEntry{"room", {1'000'000'000, 2'000'000'000}, GapCause::kDiskFull}};
  for (int i = 0; i < 4; ++i) {
    bodies.emplace_back(TokenMissedEntry{1, "swiss", std::string(500'000, 'x')});
  }
  writer->append(bodies, moment(2'000'000'000));
  writer->close("disk-full", moment(3'000'000'000));
  TokenEntry facts;
  facts.gen_time = moment(0).utc;
  facts.serial = "0a";
  const StoredCheckpoint over = writer->checkpoint(moment(3'000'000'000));
  writer->add_token(over, "swiss", bytes_of(std::string(5000, 't')), facts, moment(4'000'000'000));
  writer->finish(moment(5'000'000'000));
  EXPECT_THAT(lies_of(writer->folder(), kit), IsEmpty());
  EXPECT_EQ(test::entries_of(writer->folder()).size(), 9U);
  EXPECT_EQ(read_log(disk.path() / "log").back().type, "case-closed");
  EXPECT_LT(fs::file_size(disk.path() / ".reserve"), 8U << 20U);

  // Space returns: the next case fills the reserve again.
  fs::remove(disk.path() / "filler");
  fs::remove(disk.path() / writer->case_id() / entry.file.file);
  const auto next = CaseWriter::create(real_file_system(), options, moment(0));
  EXPECT_EQ(fs::file_size(disk.path() / ".reserve"), 8U << 20U);
}

TEST(FullDisk, ACaseIsNotBegunWithoutRoomToCloseIt) {
  const test::SmallDisk disk(4U << 20U);
  if (!disk.mounted()) {
    GTEST_SKIP() << "no permission to mount a small file system";
  }
  const test::CaseKit kit(disk.path());
  try {
    CaseWriter::create(real_file_system(), kit.options(), moment(0));
    FAIL() << "begun";
  } catch (const IoError& error) {
    EXPECT_TRUE(error.disk_full());
  }
  for (const fs::directory_entry& each : fs::directory_iterator(disk.path())) {
    EXPECT_EQ(each.path().filename(), ".reserve");
  }
  disk.fill("filler");
  EXPECT_GT(fs::file_size(disk.path() / "filler"), 3U << 20U) << "the attempt gave back what it had taken";
}

}  // namespace
}  // namespace kiroku::archive

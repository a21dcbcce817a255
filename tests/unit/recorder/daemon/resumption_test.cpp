#include "recorder/daemon/resumption.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr const char* kCase = "20260805T091502Z-3f9c21ab";
constexpr const char* kOther = "20260805T091502Z-00000000";

archive::CutOffCase cut_at(UtcTime utc, const std::string& boot) {
  archive::CutOffCase cut;
  cut.case_id = kCase;
  cut.boot_id = boot;
  cut.opened = {utc - 60s, 1'000'000'000};
  cut.last = {utc, 61'000'000'000};
  return cut;
}

const UtcTime kCut = UtcTime(std::chrono::sys_days(std::chrono::year(2026) / 8 / 5)) + 9h;

TEST(TimeSinceCut, InOneBootTheWallClockDoesNotMatter) {
  const archive::CutOffCase cut = cut_at(kCut, "this");
  for (const auto step : {0h, 5000h, -5000h}) {
    const auto since = time_since(cut, {kCut + step, 1000s, 1000s}, "this", {900s, {}});
    ASSERT_TRUE(since.elapsed);
    EXPECT_EQ(*since.elapsed, 40s);
  }
}

// The case was recorded for 60 s from 900 s on, and it is 40 s later but for the time that the machine slept.
TEST(TimeSinceCut, TimeInSuspensionCountsWhereItLiesAfterTheCut) {
  const auto since = time_since(cut_at(kCut, "this"), {kCut, 1000s, 1000s + 8h}, "this", {900s, 0s});
  EXPECT_EQ(since.elapsed, 8h + 40s);
  EXPECT_FALSE(since.is_bound);
}

TEST(TimeSinceCut, TimeInSuspensionBeforeTheCaseDoesNotCount) {
  const auto since = time_since(cut_at(kCut, "this"), {kCut, 1000s, 1000s + 8h}, "this", {900s, 8h});
  EXPECT_EQ(since.elapsed, 40s);
  EXPECT_FALSE(since.is_bound);
}

TEST(TimeSinceCut, TimeInSuspensionWhileItWasRecordedDoesNotCount) {
  archive::CutOffCase cut = cut_at(kCut, "this");
  cut.last.mono_ns += std::chrono::nanoseconds(1h).count();  // the case clock went on
  const auto since = time_since(cut, {kCut, 1000s, 1000s + 9h}, "this", {900s, 8h});
  EXPECT_EQ(since.elapsed, 40s);
}

TEST(TimeSinceCut, WhereNobodyKnowsWhenTheMachineSleptItIsABound) {
  for (const std::optional<std::chrono::nanoseconds> noted :
       {std::optional<std::chrono::nanoseconds>(), {9h}, {-8h}}) {
    const auto since = time_since(cut_at(kCut, "this"), {kCut, 1000s, 1000s + 8h}, "this", {900s, noted});
    EXPECT_EQ(since.elapsed, 8h + 40s);
    EXPECT_TRUE(since.is_bound);
    EXPECT_THAT(since.why, HasSubstr("when the machine slept is not known"));
  }
}

TEST(TimeSinceCut, SaysWhereTheWallClockIsNotSynchronised) {
  const MachineTime now{kCut + 90s, 30s, 30s, false};
  EXPECT_EQ(time_since(cut_at(kCut, "before"), now, "this", {}).why,
            "by the wall clock, which nobody has synchronised");
}

TEST(TimeSinceCut, AfterAnotherBootTheWallClockDecides) {
  const auto since = time_since(cut_at(kCut, "before"), {kCut + 90s, 30s, 30s}, "this", {});
  EXPECT_EQ(since.elapsed, 90s);
  EXPECT_EQ(since.why, "by the wall clock");
}

TEST(TimeSinceCut, AWallClockThatPutsTheCutBehindTheBootIsNotBelieved) {
  // Set back, without a battery (1970), and restored from what systemd had saved before the cut.
  for (const auto now : {kCut - 1h, UtcTime(), kCut + 5s}) {
    const auto since = time_since(cut_at(kCut, "before"), {now, 30s, 30s}, "this", {});
    EXPECT_FALSE(since.elapsed);
    EXPECT_THAT(since.why, HasSubstr("is not known"));
  }
}

class RunningNoteTest : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  RunningNote note{archive::real_file_system(), folder.path(), "or-1"};
};

TEST_F(RunningNoteTest, TellsOfTheCaseUntilItIsCleared) {
  EXPECT_FALSE(note.read());
  note.begins({kCase, kOther, "schedule", false});
  const auto running = note.read();
  ASSERT_TRUE(running);
  EXPECT_EQ(running->case_id, kCase);
  EXPECT_EQ(running->carries_on, kOther);
  EXPECT_EQ(running->reason, "schedule");
  EXPECT_FALSE(running->ending);
  note.ends(kOther);
  EXPECT_FALSE(note.read()->ending);
  note.ends(kCase);
  EXPECT_TRUE(note.read()->ending);
  note.clear(kOther);
  EXPECT_TRUE(note.read());
  note.clear(kCase);
  EXPECT_FALSE(note.read());
}

TEST_F(RunningNoteTest, HasTheNewestSubjectUntilACaseThatCarriesItOnHasOne) {
  const crypto::SigningKey key = crypto::SigningKey::generate();
  note.begins({kCase, "", "operator", false});
  note.newest_subject(sign_newest_subject(kOther, to_bytes("another case's"), key));
  EXPECT_FALSE(note.read()->subject);
  note.newest_subject(sign_newest_subject(kCase, to_bytes("typed"), key));
  note.newest_subject(sign_newest_subject(kCase, to_bytes("corrected"), key));
  note.begins({kOther, kCase, "operator", false});
  note.ends(kOther);
  const auto kept = note.read()->subject;
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->case_id, kCase);
  EXPECT_EQ(kept->sealed, to_bytes("corrected"));
  EXPECT_TRUE(is_signed(*kept, key.public_key()));
  note.newest_subject(sign_newest_subject(kOther, to_bytes("once more"), key));
  EXPECT_EQ(note.read()->subject->sealed, to_bytes("once more"));
  note.begins({kCase, "", "operator", false});
  EXPECT_FALSE(note.read()->subject) << "another operation";
}

TEST_F(RunningNoteTest, KeepsHowLongTheMachineHadSlept) {
  RunningCase begun{kCase, "", "operator", false};
  note.begins(begun);
  EXPECT_FALSE(note.read()->suspended);
  begun.suspended = 8h;
  note.begins(begun);
  note.newest_subject(sign_newest_subject(kCase, to_bytes("typed"), crypto::SigningKey::generate()));
  note.ends(kCase);
  EXPECT_EQ(note.read()->suspended, 8h);
}

TEST_F(RunningNoteTest, ASubjectCountsOnlyAsTheDeviceSignedItForThatCase) {
  const crypto::SigningKey key = crypto::SigningKey::generate();
  const NewestSubject subject = sign_newest_subject(kCase, to_bytes("typed"), key);
  EXPECT_TRUE(is_signed(subject, key.public_key()));
  EXPECT_FALSE(is_signed(subject, crypto::SigningKey::generate().public_key()));
  NewestSubject other = subject;
  other.sealed = to_bytes("somebody else");
  EXPECT_FALSE(is_signed(other, key.public_key()));
  other = subject;
  other.case_id = kOther;
  EXPECT_FALSE(is_signed(other, key.public_key()));
}

TEST_F(RunningNoteTest, ASubjectThatCannotBeReadIsNotNone) {
  const crypto::SigningKey key = crypto::SigningKey::generate();
  std::filesystem::create_directory(folder / ".running");
  for (const std::string subject : {"7", "{}", "{\"case\":\"x\"}", "{\"sealed\":\"!\",\"signature\":\"\"}"}) {
    std::ofstream(folder / ".running" / "or-1.json")
        << "{\"case\":\"" << kCase << "\",\"ending\":false,\"subject\":" << subject << "}";
    const auto running = note.read();
    ASSERT_TRUE(running && running->subject) << subject;
    EXPECT_EQ(running->subject->case_id, kCase);
    EXPECT_FALSE(is_signed(*running->subject, key.public_key()));
  }
}

TEST_F(RunningNoteTest, WhatCannotBeReadIsNoLeaveToRecord) {
  std::filesystem::create_directory(folder / ".running");
  for (const std::string text : {"", "[]", "{\"case\":7}", "{\"case\":\"../x\",\"ending\":false}"}) {
    std::ofstream(folder / ".running" / "or-1.json") << text;
    EXPECT_FALSE(note.read()) << text;
  }
  std::ofstream(folder / ".running" / "or-1.json") << "{\"case\":\"" << kCase << "\",\"ending\":\"no\"}";
  EXPECT_TRUE(note.read()->ending);
}

}  // namespace
}  // namespace kiroku::recorder

#include "archive/writing/ledger.h"

#include <cerrno>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <sys/file.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/ledger_entry.h"
#include "base/descriptor.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

class LedgerTest : public testing::Test {
 protected:
  std::unique_ptr<Ledger> open(Ledger::Sharing sharing = Ledger::Sharing::kExclusive,
                               SpaceReserve* reserve = nullptr) {
    return Ledger::open(files_, file_, sharing, reserve);
  }
  static void append(Ledger& ledger, const std::vector<std::string>& lines) {
    ledger.append([&](std::uint64_t) { return lines; });
  }
  [[nodiscard]] std::string contents() const {
    std::ifstream input(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(input), {}};
  }
  static crypto::Sha256Digest root_of(const std::vector<std::string>& lines) {
    crypto::MerkleFrontier tree;
    for (const std::string& line : lines) {
      tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    }
    return tree.root();
  }

  TemporaryFolder folder_{test::quick_parent()};
  fs::path file_ = folder_ / "ledger.jsonl";
  FaultFileSystem files_{folder_.path()};
};

TEST_F(LedgerTest, StartsEmptyWithADurableName) {
  const auto ledger = open();
  EXPECT_EQ(ledger->size(), 0U);
  EXPECT_EQ(ledger->root(), root_of({}));
  EXPECT_THAT(files_.calls(), ElementsAre("create ledger.jsonl", "sync_folder .", "lock ledger.jsonl"));
}

TEST_F(LedgerTest, AppendsSeveralLinesWithOneWriteAndOneFlush) {
  const auto ledger = open();
  files_.forget_calls();
  append(*ledger, {"one", "two"});
  append(*ledger, {"three"});
  EXPECT_THAT(files_.calls(), ElementsAre("reserve ledger.jsonl 1048584", "write ledger.jsonl 8",
                                          "sync ledger.jsonl", "write ledger.jsonl 6", "sync ledger.jsonl"));
  EXPECT_EQ(contents(), "one\ntwo\nthree\n");
  EXPECT_EQ(ledger->size(), 3U);
  EXPECT_EQ(ledger->root(), root_of({"one", "two", "three"}));
}

TEST_F(LedgerTest, TellsTheMakerHowManyLinesThereAre) {
  const auto ledger = open();
  append(*ledger, {"one", "two"});
  std::uint64_t told = 0;
  ledger->append([&](std::uint64_t size) {
    told = size;
    return std::vector<std::string>{"three"};
  });
  EXPECT_EQ(told, 2U);
}

TEST_F(LedgerTest, ReopenedHasTheSameTree) {
  append(*open(), {"one", "two", "three"});
  std::vector<std::string> seen;
  const auto ledger = Ledger::open(files_, file_, Ledger::Sharing::kExclusive, nullptr,
                                   [&](std::uint64_t seq, std::string_view line) {
                                     EXPECT_EQ(seq, seen.size());
                                     seen.emplace_back(line);
                                   });
  EXPECT_THAT(seen, ElementsAre("one", "two", "three"));
  EXPECT_EQ(ledger->root(), root_of({"one", "two", "three"}));
  EXPECT_EQ(ledger->torn_bytes(), 0U);
}

TEST_F(LedgerTest, ReadsLinesLongerThanItsBuffer) {
  const std::string long_line(700'000, 'x');
  append(*open(), {"one", long_line, "three"});
  EXPECT_EQ(open()->root(), root_of({"one", long_line, "three"}));
}

TEST_F(LedgerTest, CutsATornLastLineAndSaysHowLongItWas) {
  append(*open(), {"one"});
  std::ofstream(file_, std::ios::app) << "tw";
  const auto ledger = open();
  EXPECT_EQ(ledger->torn_bytes(), 2U);
  EXPECT_EQ(ledger->size(), 1U);
  EXPECT_EQ(contents(), "one\n");
  append(*ledger, {"two"});
  EXPECT_EQ(ledger->torn_bytes(), 0U);
  EXPECT_EQ(contents(), "one\ntwo\n");
}

TEST_F(LedgerTest, CutsOffZerosThatAPowerCutLeftUnlessACheckpointCoversThem) {
  const std::string zeros(5000, '\0');
  const std::string written = "one\ntwo\n" + zeros + "ee\nfour\n";
  const auto open_covered = [&](std::uint64_t covered) {
    std::ofstream(file_, std::ios::binary) << written;
    return Ledger::open(files_, file_, Ledger::Sharing::kExclusive, nullptr, {},
                        [covered] { return covered; });
  };
  for (const std::uint64_t covered : {0U, 2U}) {
    const auto ledger = open_covered(covered);
    EXPECT_EQ(contents(), "one\ntwo\n");
    EXPECT_EQ(ledger->torn_bytes(), zeros.size() + 8);
    EXPECT_EQ(ledger->root(), root_of({"one", "two"}));
  }
  EXPECT_EQ(open_covered(3)->size(), 4U);
  EXPECT_EQ(contents(), written) << "zeros in what was signed are for the verifier to find";
}

// What does not come is not missing: nothing is cut off that could not be read.
TEST_F(LedgerTest, CutsNothingOffThatADiskDidNotGiveBack) {
  const std::string written = "one\n" + std::string(300'000, 'x') + "\nthree\n";
  std::ofstream(file_, std::ios::binary) << written;
  for (const auto fault : {FaultFileSystem::ReadFault::kFails, FaultFileSystem::ReadFault::kEndsEarly}) {
    for (std::size_t at = 0;; ++at) {
      files_.fail_reading("", fault, at, 1);
      bool is_told = false;
      try {
        EXPECT_EQ(open()->size(), 3U);
      } catch (const Error& error) {
        is_told = true;
        EXPECT_THAT(error.what(), HasSubstr("ledger.jsonl")) << at;
      }
      EXPECT_EQ(contents(), written) << at;
      if (files_.faults_played() == 0) {
        EXPECT_GT(at, 3U);
        break;
      }
      // Behind the end a read that ends early is what any other is.
      const bool is_of_the_end =
          files_.reads().back() == "read ledger.jsonl " + std::to_string(written.size()) + " 262144";
      EXPECT_EQ(is_told, fault == FaultFileSystem::ReadFault::kFails ||
                             (files_.reads().back().starts_with("read") && !is_of_the_end))
          << files_.reads().back();
    }
  }
}

TEST_F(LedgerTest, ReadsOnWhereLessCameThanWasAskedFor) {
  std::ofstream(file_, std::ios::binary) << "one\ntwo\nthr";
  files_.fail_reading("read", FaultFileSystem::ReadFault::kHalf);
  const auto ledger = open();
  EXPECT_GT(files_.faults_played(), 1U);
  EXPECT_EQ(ledger->root(), root_of({"one", "two"}));
  EXPECT_EQ(ledger->torn_bytes(), 3U);
  EXPECT_EQ(contents(), "one\ntwo\n");
}

TEST_F(LedgerTest, ASharedLedgerThatCouldNotBeReadGoesOnWhereItStood) {
  const auto ledger = open(Ledger::Sharing::kShared);
  append(*ledger, {"one"});
  std::ofstream(file_, std::ios::app) << "two\nthree\n";
  files_.fail_reading("read", FaultFileSystem::ReadFault::kFails);
  EXPECT_THROW(append(*ledger, {"four"}), IoError);
  files_.heal();
  append(*ledger, {"four"});
  EXPECT_EQ(contents(), "one\ntwo\nthree\nfour\n");
  EXPECT_EQ(ledger->root(), root_of({"one", "two", "three", "four"}));
}

TEST_F(LedgerTest, CutsOffMoreZerosThanAnyLineHasBytes) {
  std::ofstream(file_, std::ios::binary) << "one\n" << std::string((3U << 20U) + 1, '\0');
  const auto ledger =
      Ledger::open(files_, file_, Ledger::Sharing::kExclusive, nullptr, {}, [] { return std::uint64_t{1}; });
  EXPECT_EQ(contents(), "one\n");
}

// Somebody made zeros of lines that are signed: as long as one likes, and without room on the disk.
TEST_F(LedgerTest, ReadsNoEndOfZerosThatCheckpointsCover) {
  constexpr std::uint64_t kLines = 66;
  for (std::uint64_t lines = 0; lines < kLines; ++lines) {
    std::ofstream(file_, std::ios::app) << "";
    std::filesystem::resize_file(file_, std::filesystem::file_size(file_) + (1U << 20U) - 1);
    std::ofstream(file_, std::ios::app) << "\n";
  }
  int asked = 0;
  const auto covered = [&] {
    ++asked;
    return kLines;
  };
  EXPECT_THAT([&] { Ledger::open(files_, file_, Ledger::Sharing::kShared, nullptr, {}, covered); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("hold more zeros than are read")));
  EXPECT_EQ(asked, 1) << "the checkpoints are looked at once";
}

TEST_F(LedgerTest, RefusesASecondWriter) {
  const auto ledger = open();
  try {
    open();
    FAIL() << "opened twice";
  } catch (const UsageError& error) {
    EXPECT_EQ(std::string(error.what()),
              "another process is writing " + file_.string() + ": wait until it has ended, or end it first");
  }
}

TEST_F(LedgerTest, WritersOfASharedLedgerTakeTurns) {
  const auto first = open(Ledger::Sharing::kShared);
  const auto second = open(Ledger::Sharing::kShared);
  append(*first, {"one"});
  append(*second, {"two"});
  append(*first, {"three"});
  EXPECT_EQ(contents(), "one\ntwo\nthree\n");
  second->catch_up();
  EXPECT_EQ(first->root(), root_of({"one", "two", "three"}));
  EXPECT_EQ(second->root(), first->root());
}

TEST_F(LedgerTest, ASharedLedgerCutsTheTornLineOfAWriterThatDied) {
  const auto ledger = open(Ledger::Sharing::kShared);
  append(*ledger, {"one"});
  std::ofstream(file_, std::ios::app) << "to";
  std::uint64_t torn = 0;
  ledger->append([&](std::uint64_t) {
    torn = ledger->torn_bytes();
    return std::vector<std::string>{"two"};
  });
  EXPECT_EQ(torn, 2U);
  EXPECT_EQ(contents(), "one\ntwo\n");
}

TEST_F(LedgerTest, NestedTurnsKeepTheLockToTheOutermostEnd) {
  const auto ledger = open(Ledger::Sharing::kShared);
  const auto other = real_file_system().append_to(file_);
  {
    const Ledger::Turn turn(*ledger);
    append(*ledger, {"one"});
    EXPECT_FALSE(other->try_lock());
  }
  EXPECT_TRUE(other->try_lock());
}

TEST_F(LedgerTest, RefusesLinesThatAreNoLines) {
  const auto ledger = open();
  EXPECT_THROW(append(*ledger, {"a\nb"}), Error);
  EXPECT_THROW(append(*ledger, {""}), Error);
  EXPECT_THROW(append(*ledger, {std::string(kMaximumLineBytes + 1, 'x')}), Error);
  EXPECT_EQ(contents(), "");
}

TEST_F(LedgerTest, RefusesAFileWithALineLongerThanTheFormats) {
  std::ofstream(file_) << "one\n" << std::string(2 * kMaximumLineBytes, 'x');
  try {
    open();
    FAIL() << "opened";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("line 2 of"));
  }
}

TEST_F(LedgerTest, AFullDiskLeavesNoPartOfALineAndALaterAppendSucceeds) {
  const auto ledger = open();
  append(*ledger, {"one"});
  files_.fail("write", ENOSPC);
  EXPECT_THROW(append(*ledger, {"two", "three"}), IoError);
  EXPECT_EQ(contents(), "one\n");
  EXPECT_EQ(ledger->size(), 1U);
  files_.heal();
  append(*ledger, {"two"});
  EXPECT_EQ(contents(), "one\ntwo\n");
}

TEST_F(LedgerTest, AFailedFlushIsFinal) {
  const auto ledger = open();
  append(*ledger, {"one"});
  files_.fail("sync ledger.jsonl", EIO);
  EXPECT_THROW(append(*ledger, {"two"}), SyncError);
  EXPECT_EQ(ledger->size(), 1U) << "what may be lost is not in the tree";
  files_.heal();
  files_.forget_calls();
  EXPECT_THROW(append(*ledger, {"three"}), Error);
  EXPECT_THROW(ledger->trim(), Error);
  EXPECT_THAT(files_.calls(), ElementsAre());
}

TEST_F(LedgerTest, AWriteErrorThatCannotBeUndoneIsFinal) {
  const auto ledger = open();
  append(*ledger, {"one"});
  files_.fail("", EIO);
  EXPECT_THROW(append(*ledger, {"two"}), Error);
  files_.heal();
  EXPECT_THROW(append(*ledger, {"three"}), Error);
}

// The appliance log, that all rooms share: one failure of the disk must not end their recording for good.
TEST_F(LedgerTest, ASharedLedgerIsOpenedAnewAfterAFailedFlush) {
  std::vector<std::string> seen;
  const auto ledger = Ledger::open(files_, file_, Ledger::Sharing::kShared, nullptr,
                                   [&](std::uint64_t seq, std::string_view line) {
                                     seen.resize(seq);
                                     seen.emplace_back(line);
                                   });
  append(*ledger, {"one"});
  files_.fail("sync ledger.jsonl", EIO, 0, 2);
  EXPECT_THROW(append(*ledger, {"two"}), SyncError);
  EXPECT_EQ(ledger->size(), 1U);
  EXPECT_THROW(append(*ledger, {"three"}), SyncError) << "the disk has not come back yet";
  EXPECT_EQ(contents(), "one\n") << "what may be lost is cut off, so that nothing stands behind it";
  files_.forget_calls();
  append(*ledger, {"four"});
  EXPECT_EQ(contents(), "one\nfour\n");
  EXPECT_THAT(seen, ElementsAre("one", "four"));
  EXPECT_EQ(ledger->root(), root_of({"one", "four"}));
  EXPECT_EQ(ledger->torn_bytes(), 0U) << "nobody counted on it";
  EXPECT_THAT(files_.calls(), testing::IsSupersetOf({"open ledger.jsonl", "sync ledger.jsonl"}));
  files_.lose_power();
  EXPECT_EQ(contents(), "one\nfour\n");
}

TEST_F(LedgerTest, ASharedLedgerCutsNothingOffThatOthersBuiltUpon) {
  const auto ledger = open(Ledger::Sharing::kShared);
  append(*ledger, {"one"});
  files_.fail("sync ledger.jsonl", EIO, 0, 1);
  EXPECT_THROW(append(*ledger, {"two"}), SyncError);
  append(*open(Ledger::Sharing::kShared), {"other"});
  append(*ledger, {"three"});
  EXPECT_EQ(contents(), "one\ntwo\nother\nthree\n");
  EXPECT_EQ(ledger->root(), root_of({"one", "two", "other", "three"}));
  // Nor where a checkpoint was signed over it.
  std::uint64_t covered = 0;
  const auto signing =
      Ledger::open(files_, file_, Ledger::Sharing::kShared, nullptr, {}, [&] { return covered; });
  files_.fail("sync ledger.jsonl", EIO, 0, 1);
  EXPECT_THROW(append(*signing, {"four"}), SyncError);
  covered = 5;
  append(*signing, {"five"});
  EXPECT_EQ(contents(), "one\ntwo\nother\nthree\nfour\nfive\n");
}

// Another process that read the line, and has not written behind it, must not sign over it.
TEST_F(LedgerTest, ALineThatItsWriterCutsOffIsForgottenByWhoeverReadIt) {
  for (const std::string& instead : std::vector<std::string>{"t", "quite another line"}) {
    std::filesystem::remove(file_);
    const auto ledger = open(Ledger::Sharing::kShared);
    append(*ledger, {"one"});
    const auto other = open(Ledger::Sharing::kShared);
    append(*other, {"two"});
    ledger->catch_up();
    files_.fail("sync ledger.jsonl", EIO, 0, 1);
    EXPECT_THROW(append(*ledger, {"lost"}), SyncError);
    other->catch_up();
    EXPECT_EQ(other->size(), 3U);
    append(*ledger, {instead});
    append(*other, {"behind it"});
    EXPECT_EQ(contents(), "one\ntwo\n" + instead + "\nbehind it\n");
    EXPECT_EQ(other->root(), root_of({"one", "two", instead, "behind it"}));
    EXPECT_EQ(other->size(), 4U);
    // What it entered itself must still be there.
    std::ofstream(file_, std::ios::trunc) << "one\n";
    EXPECT_THROW(append(*other, {"no more"}), Error);
    EXPECT_THROW(append(*other, {"nor now"}), Error);
    EXPECT_EQ(contents(), "one\n");
  }
}

TEST_F(LedgerTest, ASharedLedgerThatIsNotAsItWasFlushedIsNotWrittenTo) {
  const auto ledger = open(Ledger::Sharing::kShared);
  append(*ledger, {"one", "two"});
  files_.fail("sync ledger.jsonl", EIO, 0, 1);
  EXPECT_THROW(append(*ledger, {"three"}), SyncError);
  std::ofstream(file_) << "one\nTWO\n";
  for (int tries = 0; tries < 2; ++tries) {
    try {
      append(*ledger, {"three"});
      FAIL() << "written";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("is not as it was before its disk failed"));
    }
  }
  std::ofstream(file_) << "one\n";
  EXPECT_THROW(append(*ledger, {"three"}), Error);
  EXPECT_EQ(contents(), "one\n");
}

// flock needs no more than a file that may be read.
TEST_F(LedgerTest, WhoeverLocksASharedLedgerIsToldAndNotWaitedForForEver) {
  const auto ledger = open(Ledger::Sharing::kShared);
  append(*ledger, {"one"});
  {
    const Descriptor reader(::open(file_.c_str(), O_RDONLY | O_CLOEXEC));
    ASSERT_EQ(::flock(reader.number(), LOCK_EX | LOCK_NB), 0);
    ledger->wait_at_most(std::chrono::milliseconds(20));
    for (int tries = 0; tries < 2; ++tries) {
      try {
        append(*ledger, {"two"});
        FAIL() << "written";
      } catch (const LedgerHeldError& error) {
        EXPECT_THAT(error.what(), HasSubstr("another process holds " + file_.string()));
      }
    }
  }
  append(*ledger, {"two"});
  EXPECT_EQ(contents(), "one\ntwo\n");
}

TEST_F(LedgerTest, UsesTheReserveWhenTheDiskIsFull) {
  SpaceReserve reserve(real_file_system(), reserve_file(folder_.path()));
  reserve.fill();
  const auto ledger = open(Ledger::Sharing::kExclusive, &reserve);
  append(*ledger, {"one"});
  files_.fail("write", ENOSPC, 0, 2);
  append(*ledger, {"two"});
  EXPECT_EQ(contents(), "one\ntwo\n");
  EXPECT_EQ(fs::file_size(folder_ / ".reserve"), SpaceReserve::kBytes - 2 * SpaceReserve::kStep);
}

TEST_F(LedgerTest, TellsTheFullDiskWhenTheReserveDoesNotDo) {
  SpaceReserve reserve(real_file_system(), reserve_file(folder_.path()));
  reserve.fill();
  const auto ledger = open(Ledger::Sharing::kExclusive, &reserve);
  files_.fail("write", ENOSPC);
  EXPECT_THROW(append(*ledger, {"one"}), IoError);
  EXPECT_EQ(fs::file_size(folder_ / ".reserve"), 0U) << "every step was tried";
  EXPECT_EQ(contents(), "");
}

TEST_F(LedgerTest, WhereverItIsKilledEveryFlushedLineIsThere) {
  for (const bool power : {false, true}) {
    for (std::size_t at = 0; at < 9; ++at) {
      const TemporaryFolder folder(test::quick_parent());
      FaultFileSystem files(folder.path());
      files.kill_at(at);
      std::vector<std::string> confirmed;
      const std::vector<std::string> wanted{"first", "second", "third"};
      try {
        const auto ledger = Ledger::open(files, folder / "l", Ledger::Sharing::kExclusive, nullptr);
        for (const std::string& line : wanted) {
          append(*ledger, {line});
          confirmed.push_back(line);
        }
      } catch (const test::Killed&) {
      }
      if (power) {
        files.lose_power();
      }
      files.heal();
      std::vector<std::string> found;
      Ledger::open(files, folder / "l", Ledger::Sharing::kExclusive, nullptr,
                   [&](std::uint64_t, std::string_view line) { found.emplace_back(line); });
      ASSERT_GE(found.size(), confirmed.size()) << at;
      ASSERT_LE(found.size(), confirmed.size() + 1) << at;
      EXPECT_TRUE(std::equal(found.begin(), found.end(), wanted.begin())) << at;
    }
  }
}

}  // namespace
}  // namespace kiroku::archive
